"""Patterns of moving foci as a source of drives, beside recordings."""

from .adaptics import AdapticsPattern as AdapticsPattern
from .adaptics import Evaluated as Evaluated
from .adaptics import load_adaptics as load_adaptics
from .adaptics import read_adaptics as read_adaptics
from .drawing import Foci as Foci
from .drawing import check_reach as check_reach
from .drawing import draw as draw
from .drawing import draw_parts as draw_parts
from .drawing import drawn_settings as drawn_settings
from .drawing import palm_pressure as palm_pressure
from .drawing import reachable_pressure as reachable_pressure
from .drawing import wanted_amplitude as wanted_amplitude
from .drawing import wanted_pressure as wanted_pressure
from .pattern import PALETTE as PALETTE
from .pattern import PATTERN_ENDINGS as PATTERN_ENDINGS
from .pattern import AmplitudeModulation as AmplitudeModulation
from .pattern import LateralModulation as LateralModulation
from .pattern import Pattern as Pattern
from .pattern import ReceptorWeights as ReceptorWeights
from .pattern import SignalModulation as SignalModulation
from .pattern import Spot as Spot
from .pattern import draw_file as draw_file
from .pattern import load_pattern as load_pattern
from .shapes import SHAPES as SHAPES
from .shapes import Shape as Shape
