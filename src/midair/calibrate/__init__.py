"""Calibrate: from a recording in volts or counts to pressure in Pa, within the band in which the sensor hears.

And before that: measure the calibration, against a reference (`measure_calibration`, `measure_tone`) or by a focused
beam (`midair.calibrate.beam`).
"""

from midair.calibrate.channels import clipped_share, dead_channels
from midair.calibrate.crosstalk import undo_crosstalk, undo_matrix
from midair.calibrate.evidence import MeasureSettings
from midair.calibrate.inverse import default_taps, inverse_fir, inverse_response
from midair.calibrate.measure import measure_calibration, measure_response
from midair.calibrate.noise import noise_equivalent_pressure
from midair.calibrate.pressure import Method, calibrate, typical_uncertainty
from midair.calibrate.stream import StreamingInverse
from midair.calibrate.takes import Reference, Take, split_channel
from midair.calibrate.tone import anchored, measure_tone

__all__ = [
    "MeasureSettings",
    "Method",
    "Reference",
    "StreamingInverse",
    "Take",
    "anchored",
    "calibrate",
    "clipped_share",
    "dead_channels",
    "default_taps",
    "inverse_fir",
    "inverse_response",
    "measure_calibration",
    "measure_response",
    "measure_tone",
    "noise_equivalent_pressure",
    "split_channel",
    "typical_uncertainty",
    "undo_crosstalk",
    "undo_matrix",
]
