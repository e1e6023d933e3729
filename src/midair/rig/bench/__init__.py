"""Measure calibrations of sensors and arrays, and identify which channel belongs to which cell."""

from midair.rig.bench.array_bench import calibrate_array
from midair.rig.bench.beam_bench import calibrate_by_beam
from midair.rig.bench.calibration_page import calibration_rows, check_page_name, uncertainty_of, write_calibration_page
from midair.rig.bench.identify import Identity, findings
from midair.rig.bench.practice import PRACTICE, write_practice
from midair.rig.bench.reference_files import ReferenceChoice, read_quiet, read_takes
from midair.rig.bench.tap_test import TapTest, identify_by_taps, identify_by_tones

__all__ = [
    "Identity",
    "ReferenceChoice",
    "TapTest",
    "calibrate_array",
    "calibrate_by_beam",
    "calibration_rows",
    "check_page_name",
    "findings",
    "identify_by_taps",
    "identify_by_tones",
    "read_quiet",
    "read_takes",
    "uncertainty_of",
    "write_calibration_page",
    "PRACTICE",
    "write_practice",
]
