"""Read and write recordings, calibrations and drives in HDF5, and recordings in other formats."""

from typing import TYPE_CHECKING

from midair.lazy import lazy_names

if TYPE_CHECKING:
    from .atomic import NoLocksWarning as NoLocksWarning
    from .atomic import atomic_file as atomic_file
    from .atomic import atomic_folder as atomic_folder
    from .atomic import check_not_recording as check_not_recording
    from .atomic import collect_written_files as collect_written_files
    from .atomic import lock_or_raise as lock_or_raise
    from .atomic import parse_errors as parse_errors
    from .atomic import writable_path as writable_path
    from .atomic import write_file as write_file
    from .formats import FORMATS as FORMATS
    from .formats import contents as contents
    from .formats import format_of as format_of
    from .formats import load as load
    from .formats import open_take as open_take
    from .formats import save as save
    from .formats import write_errors as write_errors
    from .formats import writer_of as writer_of
    from .importers.csv_file import load_palm_path as load_palm_path
    from .importers.csv_file import save_palm_path as save_palm_path
    from .native.calibration_file import ARRAY_SUFFIX as ARRAY_SUFFIX
    from .native.calibration_file import CALIBRATION_SUFFIX as CALIBRATION_SUFFIX
    from .native.calibration_file import load_array_calibration as load_array_calibration
    from .native.calibration_file import load_calibration as load_calibration
    from .native.calibration_file import save_array_calibration as save_array_calibration
    from .native.calibration_file import save_calibration as save_calibration
    from .native.drive_file import DRIVE_SUFFIX as DRIVE_SUFFIX
    from .native.drive_file import load_prediction as load_prediction
    from .native.drive_file import load_solution as load_solution
    from .native.drive_file import load_target as load_target
    from .native.drive_file import save_solution as save_solution
    from .native.drive_file import save_solutions as save_solutions
    from .native.drive_file import store_prediction as store_prediction
    from .native.recording_file import RecordingBuffer as RecordingBuffer
    from .native.recording_file import load_played as load_played
    from .native.recording_file import load_pressure as load_pressure
    from .native.recording_file import repair as repair
    from .native.recording_writer import RecordingWriter as RecordingWriter
    from .opened_take import Format as Format
    from .opened_take import FormatLoss as FormatLoss
    from .opened_take import ImportOptions as ImportOptions
    from .opened_take import OpenedTake as OpenedTake
    from .size_limits import check_expansion as check_expansion
    from .size_limits import check_memory_for as check_memory_for
    from .text_files import csv_text as csv_text
    from .text_files import for_json as for_json
    from .text_files import json_of as json_of
    from .text_files import no_formula as no_formula
    from .text_files import printable as printable
    from .text_files import read_text as read_text
    from .text_files import read_toml as read_toml
    from .text_files import toml_of as toml_of
    from .toml.exposure_profiles import DEFAULT_PROFILE as DEFAULT_PROFILE
    from .toml.exposure_profiles import from_plain as from_plain
    from .toml.exposure_profiles import load_profiles as load_profiles
    from .toml.exposure_profiles import profile_named as profile_named
    from .toml.exposure_profiles import to_plain as to_plain
    from .toml.hardware import Laboratory as Laboratory
    from .toml.hardware import load_laboratory as load_laboratory
    from .toml.hardware import load_palm as load_palm
    from .toml.hardware import load_placement as load_placement
    from .toml.hardware import load_sensor as load_sensor
    from .toml.hardware import load_stage as load_stage
    from .toml.hardware import load_tracker as load_tracker
    from .toml.hardware import save_laboratory as save_laboratory
    from .toml.hardware import save_sensor as save_sensor
    from .toml.hardware import save_tracker as save_tracker
else:
    __getattr__, __dir__ = lazy_names(__name__)
