"""session.toml, and which videos it holds for."""
