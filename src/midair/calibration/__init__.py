"""Calibrate: from a recording in volts or counts to pressure in Pa, within the band in which the sensor hears.

And before that: measure the calibration, against a reference (`measure_calibration`, `measure_tone`) or by a focused
beam (`midair.calibration.measure.beam`).
"""

from midair.calibration.apply import (
    Method,
    StreamingInverse,
    calibrate,
    default_taps,
    inverse_fir,
    inverse_response,
    typical_uncertainty,
    undo_matrix,
)
from midair.calibration.measure import (
    BeamPlan,
    BeamReading,
    BeamSetting,
    MeasureSettings,
    Reference,
    ReferencedTake,
    anchored,
    beam_field,
    find_lag,
    focus_of,
    measure_beam,
    measure_calibration,
    measure_response,
    measure_tone,
    noise_equivalent_pressure,
    noise_signal,
    split_channel,
    sweep_signal,
    tones_of,
)

__all__ = [
    "BeamPlan",
    "BeamReading",
    "BeamSetting",
    "MeasureSettings",
    "Method",
    "Reference",
    "ReferencedTake",
    "StreamingInverse",
    "anchored",
    "beam_field",
    "calibrate",
    "default_taps",
    "find_lag",
    "focus_of",
    "inverse_fir",
    "inverse_response",
    "measure_beam",
    "measure_calibration",
    "measure_response",
    "measure_tone",
    "noise_equivalent_pressure",
    "noise_signal",
    "split_channel",
    "sweep_signal",
    "tones_of",
    "typical_uncertainty",
    "undo_matrix",
]
