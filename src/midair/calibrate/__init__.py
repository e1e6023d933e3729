"""Calibrate: from a recording in volts or counts to pressure in Pa, within the band in which the sensor hears."""

from midair.calibrate.channels import clipped_share, dead_channels
from midair.calibrate.inverse import default_taps, inverse_fir, inverse_response
from midair.calibrate.measure import measure_response
from midair.calibrate.pressure import Method, calibrate

__all__ = [
    "Method",
    "calibrate",
    "clipped_share",
    "dead_channels",
    "default_taps",
    "inverse_fir",
    "inverse_response",
    "measure_response",
]
