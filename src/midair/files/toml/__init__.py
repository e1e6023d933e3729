"""What people write by hand in TOML."""

from midair.files.toml.plain import from_plain, to_plain
from midair.files.toml.sensors import load_sensor, save_sensor

__all__ = [
    "from_plain",
    "to_plain",
    "load_sensor",
    "save_sensor",
]
