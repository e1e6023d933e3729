"""A sensor over UDP and a raw file format, registered with midair by the entry points in pyproject.toml."""
