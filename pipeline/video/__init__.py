"""Any input → grey frames."""
