"""Files: recordings, calibrations and drives in HDF5, and recordings in the formats of other programs."""

from midair.files.atomic import refusing, whole_file, writable_path
from midair.files.formats import FORMATS, format_of, load, read, save
from midair.files.imported import Imported
from midair.files.listing import Contents, contents
from midair.files.loss import Loss
from midair.files.native import (
    CALIBRATION_SUFFIX,
    Event,
    EventKind,
    RecordingWriter,
    load_calibration,
    load_pressure,
    load_solution,
    load_target,
    repair,
    save_calibration,
    save_pressure,
    save_solution,
    to_json,
)
from midair.files.toml import (
    DEFAULT_PROFILE,
    from_plain,
    load_profiles,
    load_sensor,
    profile_named,
    save_sensor,
    to_plain,
)

__all__ = [
    "CALIBRATION_SUFFIX",
    "Contents",
    "Event",
    "EventKind",
    "DEFAULT_PROFILE",
    "FORMATS",
    "Imported",
    "Loss",
    "RecordingWriter",
    "contents",
    "format_of",
    "from_plain",
    "load",
    "load_calibration",
    "load_pressure",
    "load_profiles",
    "load_sensor",
    "load_solution",
    "load_target",
    "profile_named",
    "read",
    "refusing",
    "repair",
    "save",
    "save_calibration",
    "save_pressure",
    "save_sensor",
    "save_solution",
    "to_json",
    "to_plain",
    "whole_file",
    "writable_path",
]
