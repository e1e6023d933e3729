"""Correct a reproduction from its re-recording or prediction: gains (paper, 5.2), iteration, envelope prediction."""

from .envelope_prediction import EnvelopePrediction as EnvelopePrediction
from .gains import BeamGain as BeamGain
from .gains import amplitude_gain as amplitude_gain
from .gains import beam_drive as beam_drive
from .gains import beam_gain as beam_gain
from .gains import commanded_pressure as commanded_pressure
from .gains import correct_air as correct_air
from .gains import sine_amplitude as sine_amplitude
from .iterative import IterativeCorrection as IterativeCorrection
from .iterative import MinimumNorm as MinimumNorm
from .iterative import Response as Response
from .iterative import measured_response as measured_response
