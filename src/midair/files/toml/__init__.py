"""TOML files that users write by hand."""

from midair.files.toml.exposure_profiles import DEFAULT_PROFILE, load_profiles, profile_named
from midair.files.toml.palms import load_palm
from midair.files.toml.placements import load_placement
from midair.files.toml.plain import from_plain, to_plain
from midair.files.toml.sensors import load_sensor, save_sensor
from midair.files.toml.stages import load_stage

__all__ = [
    "from_plain",
    "to_plain",
    "DEFAULT_PROFILE",
    "load_palm",
    "load_placement",
    "load_profiles",
    "load_sensor",
    "load_stage",
    "profile_named",
    "save_sensor",
]
