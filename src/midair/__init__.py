"""midair: a tape recorder for touch."""

__version__ = "0.1.0"
