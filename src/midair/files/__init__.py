"""Read and write recordings, calibrations and drives in HDF5, and recordings in other formats."""

from midair.files.atomic import atomic_file, atomic_folder, collect_written_files, parse_errors, writable_path
from midair.files.file_locks import NoLocksWarning, check_not_recording, lock_or_raise
from midair.files.format_loss import FormatLoss
from midair.files.formats import FORMATS, format_of, load, open_take, save
from midair.files.importers import load_board
from midair.files.listing import Contents, contents
from midair.files.native import (
    ARRAY_SUFFIX,
    CALIBRATION_SUFFIX,
    DRIVE_SUFFIX,
    RecordingWriter,
    load_array_calibration,
    load_calibration,
    load_played,
    load_pressure,
    load_solution,
    load_target,
    repair,
    save_array_calibration,
    save_calibration,
    save_pressure,
    save_solution,
    save_solutions,
    to_json,
)
from midair.files.opened_take import Format, ImportOptions, OpenedTake
from midair.files.report_rows import csv_text, for_json
from midair.files.sanitise_text import no_formula, printable
from midair.files.size_check import check_memory_for
from midair.files.text_files import json_of, read_text, read_toml, toml_of
from midair.files.toml import (
    DEFAULT_PROFILE,
    from_plain,
    load_palm,
    load_placement,
    load_profiles,
    load_sensor,
    load_stage,
    profile_named,
    save_sensor,
    to_plain,
)

__all__ = [
    "ARRAY_SUFFIX",
    "CALIBRATION_SUFFIX",
    "Contents",
    "DEFAULT_PROFILE",
    "DRIVE_SUFFIX",
    "FORMATS",
    "Format",
    "ImportOptions",
    "OpenedTake",
    "FormatLoss",
    "NoLocksWarning",
    "RecordingWriter",
    "check_memory_for",
    "check_not_recording",
    "contents",
    "csv_text",
    "collect_written_files",
    "for_json",
    "format_of",
    "from_plain",
    "lock_or_raise",
    "json_of",
    "load",
    "load_board",
    "load_array_calibration",
    "load_calibration",
    "load_played",
    "load_pressure",
    "load_palm",
    "load_placement",
    "load_profiles",
    "load_sensor",
    "load_solution",
    "load_stage",
    "load_target",
    "no_formula",
    "open_take",
    "printable",
    "profile_named",
    "read_text",
    "read_toml",
    "parse_errors",
    "repair",
    "save",
    "save_array_calibration",
    "save_calibration",
    "save_pressure",
    "save_sensor",
    "save_solution",
    "save_solutions",
    "to_json",
    "to_plain",
    "toml_of",
    "atomic_file",
    "atomic_folder",
    "writable_path",
]
