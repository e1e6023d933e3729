"""What people write by hand in TOML."""
