"""What people write by hand in TOML."""

from midair.files.toml.sensors import load_sensor, save_sensor

__all__ = [
    "load_sensor",
    "save_sensor",
]
