"""The laws: radiation pressure, directivity, propagation, transducer dynamics, sensing. Pure functions."""

from midair.physics.directivity import Directivity, off_axis
from midair.physics.dynamics import TransducerDynamics, envelope
from midair.physics.propagation import (
    focus_amplitude,
    focus_phase,
    propagate,
    quantise_phase,
    transfer_matrix,
    wavenumber,
)
from midair.physics.radiation import radiation_pressure, sound_amplitude
from midair.physics.sensing import SensorModel, calibration_of, cell_weights, channel_response, sense

__all__ = [
    "Directivity",
    "SensorModel",
    "TransducerDynamics",
    "calibration_of",
    "cell_weights",
    "channel_response",
    "envelope",
    "focus_amplitude",
    "focus_phase",
    "off_axis",
    "propagate",
    "quantise_phase",
    "radiation_pressure",
    "sense",
    "sound_amplitude",
    "transfer_matrix",
    "wavenumber",
]
