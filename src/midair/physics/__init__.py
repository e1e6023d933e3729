"""The laws: radiation pressure, directivity, propagation, transducer dynamics, sensing, exposure. Pure functions."""

from midair.physics.directivity import Directivity, off_axis
from midair.physics.dynamics import TransducerDynamics, envelope
from midair.physics.exposure import Exposure, ExposureProfile, exposure, profiles_of, sound_level
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
    "Exposure",
    "ExposureProfile",
    "SensorModel",
    "TransducerDynamics",
    "calibration_of",
    "cell_weights",
    "channel_response",
    "envelope",
    "exposure",
    "focus_amplitude",
    "focus_phase",
    "off_axis",
    "profiles_of",
    "propagate",
    "quantise_phase",
    "radiation_pressure",
    "sense",
    "sound_level",
    "sound_amplitude",
    "transfer_matrix",
    "wavenumber",
]
