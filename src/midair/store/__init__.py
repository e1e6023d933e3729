"""Files: recordings, calibrations and drives in HDF5, and recordings in the formats of other programs."""

from midair.store.calibration_file import load_calibration, save_calibration
from midair.store.contents import Contents, contents
from midair.store.drive_file import load_solution, load_target, save_solution
from midair.store.formats import FORMATS, load, read, save
from midair.store.imported import Imported
from midair.store.loss import Loss
from midair.store.recording_file import load_pressure, repair, save_pressure
from midair.store.sensor_file import load_sensor, save_sensor
from midair.store.writer import RecordingWriter

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
