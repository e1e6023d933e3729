"""Correct: what was re-recorded tells what to change; gains of beam and amplitude (paper, 5.2), and iteration."""

from midair.correct.gains import BeamGain, amplitude_gain, beam_drive, beam_gain, beat_amplitude, commanded_pressure
from midair.correct.iterative import IterativeCorrection, Response, measured_response
from midair.correct.minimum_norm import MinimumNorm

__all__ = [
    "BeamGain",
    "IterativeCorrection",
    "MinimumNorm",
    "Response",
    "amplitude_gain",
    "beam_drive",
    "beam_gain",
    "beat_amplitude",
    "commanded_pressure",
    "measured_response",
]
