"""What does not move: background, noise, face, pole."""
