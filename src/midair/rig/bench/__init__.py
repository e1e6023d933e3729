"""Measure calibrations of sensors and arrays, and identify which channel belongs to which cell."""

from midair.rig.bench.array_bench import calibrate_array
from midair.rig.bench.beam_bench import calibrate_by_beam
from midair.rig.bench.calibration_page import (
    calibration_rows,
    check_page_name,
    describe_uncertainty,
    write_calibration_page,
)
from midair.rig.bench.identify import Identity, assignment_problems
from midair.rig.bench.reference_files import ReferenceChoice, read_silence, read_takes
from midair.rig.bench.simulated_bench import PRACTICE_RECORDINGS, write_practice_recordings
from midair.rig.bench.tap_test import TapTest, identify_by_taps, identify_by_tones

__all__ = [
    "Identity",
    "ReferenceChoice",
    "TapTest",
    "calibrate_array",
    "calibrate_by_beam",
    "calibration_rows",
    "check_page_name",
    "assignment_problems",
    "identify_by_taps",
    "identify_by_tones",
    "read_silence",
    "read_takes",
    "describe_uncertainty",
    "write_calibration_page",
    "PRACTICE_RECORDINGS",
    "write_practice_recordings",
]
