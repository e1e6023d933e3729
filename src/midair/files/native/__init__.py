"""midair's own file formats: HDF5 with a documented schema, and NetCDF."""

from midair.files.native.array_file import ARRAY_SUFFIX, load_array_calibration, save_array_calibration
from midair.files.native.calibration_file import CALIBRATION_SUFFIX, load_calibration, save_calibration
from midair.files.native.drive_file import DRIVE_SUFFIX, load_solution, load_target, save_solution, save_solutions
from midair.files.native.hdf5 import check_kind, kind_of, open_file, open_plain, plain_text, stored_dataset
from midair.files.native.netcdf_file import NETCDF4
from midair.files.native.played_group import load_played
from midair.files.native.provenance_json import from_plain, to_json, to_plain
from midair.files.native.recording_file import HDF5, load_pressure, repair, save_pressure, write_recording
from midair.files.native.recording_writer import RecordingWriter
from midair.files.native.schema import FORMAT, Kind

__all__ = [
    "HDF5",
    "NETCDF4",
    "ARRAY_SUFFIX",
    "CALIBRATION_SUFFIX",
    "DRIVE_SUFFIX",
    "FORMAT",
    "Kind",
    "RecordingWriter",
    "check_kind",
    "from_plain",
    "kind_of",
    "load_array_calibration",
    "load_calibration",
    "load_played",
    "load_pressure",
    "load_solution",
    "load_target",
    "open_file",
    "open_plain",
    "plain_text",
    "repair",
    "save_array_calibration",
    "save_calibration",
    "save_pressure",
    "save_solution",
    "save_solutions",
    "stored_dataset",
    "to_json",
    "to_plain",
    "write_recording",
]
