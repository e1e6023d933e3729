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

__all__ = [
    "Directivity",
    "TransducerDynamics",
    "envelope",
    "focus_amplitude",
    "focus_phase",
    "off_axis",
    "propagate",
    "quantise_phase",
    "radiation_pressure",
    "sound_amplitude",
    "transfer_matrix",
    "wavenumber",
]
