"""Files: recordings, calibrations and drives in HDF5, and recordings in the formats of other programs."""

from midair.files.contents import Contents, contents
from midair.files.formats import FORMATS, load, read, save
from midair.files.imported import Imported
from midair.files.loss import Loss
from midair.files.native.calibration_file import load_calibration, save_calibration
from midair.files.native.drive_file import load_solution, load_target, save_solution
from midair.files.native.recording_file import load_pressure, repair, save_pressure
from midair.files.native.recording_writer import RecordingWriter
from midair.files.toml.sensors import load_sensor, save_sensor

__all__ = [
    "FORMATS",
    "Contents",
    "Imported",
    "Loss",
    "RecordingWriter",
    "contents",
    "load",
    "load_calibration",
    "load_pressure",
    "load_sensor",
    "load_solution",
    "load_target",
    "read",
    "repair",
    "save",
    "save_calibration",
    "save_pressure",
    "save_sensor",
    "save_solution",
]
