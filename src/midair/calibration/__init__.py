"""Calibrate: from a recording in volts or counts to pressure in Pa, within the band in which the sensor hears.

And before that: measure the calibration, against a reference (`measure_calibration`, `measure_tone`) or by a focused
beam (`midair.calibration.measure.beam`).
"""

from midair.calibration.apply.inverse import default_taps, inverse_fir, inverse_response
from midair.calibration.apply.pressure import Method, calibrate, typical_uncertainty
from midair.calibration.apply.streaming_inverse import StreamingInverse
from midair.calibration.crosstalk import undo_crosstalk, undo_matrix
from midair.calibration.measure.against_reference import measure_calibration, measure_response
from midair.calibration.measure.evidence import MeasureSettings
from midair.calibration.measure.noise import noise_equivalent_pressure
from midair.calibration.measure.referenced_take import Reference, Take, split_channel
from midair.calibration.measure.tone import anchored, measure_tone
from midair.recordings.quality import clipped_share, dead_channels

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
