"""What people look at: figures, report, overlay."""
