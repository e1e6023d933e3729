"""Correct a reproduction from its re-recording or prediction: gains (paper, 5.2), iteration, envelope prediction."""

from .envelope_prediction import EnvelopePrediction as EnvelopePrediction
from .iterative import BeamGain as BeamGain
from .iterative import IterativeCorrection as IterativeCorrection
from .iterative import Response as Response
from .iterative import amplitude_gain as amplitude_gain
from .iterative import beam_drive as beam_drive
from .iterative import beam_gain as beam_gain
from .iterative import commanded_pressure as commanded_pressure
from .iterative import correct_air as correct_air
from .iterative import focused_drive as focused_drive
from .iterative import measured_response as measured_response
from .iterative import minimum_norm as minimum_norm
from .iterative import sine_amplitude as sine_amplitude
