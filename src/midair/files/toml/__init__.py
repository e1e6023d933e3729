"""TOML files that users write by hand."""
