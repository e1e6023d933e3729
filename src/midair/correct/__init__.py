"""Correct a reproduction from its re-recording or prediction: gains (paper, 5.2), iteration, envelope prediction."""

from midair.correct.envelope_prediction import EnvelopePrediction
from midair.correct.gains import BeamGain, amplitude_gain, beam_drive, beam_gain, commanded_pressure, sine_amplitude
from midair.correct.iterative import IterativeCorrection, Response, measured_response
from midair.correct.minimum_norm import MinimumNorm

__all__ = [
    "BeamGain",
    "EnvelopePrediction",
    "IterativeCorrection",
    "MinimumNorm",
    "Response",
    "amplitude_gain",
    "beam_drive",
    "beam_gain",
    "sine_amplitude",
    "commanded_pressure",
    "measured_response",
]
