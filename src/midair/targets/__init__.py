"""Convert the pressure on a few cells to target sound amplitudes at the control points (paper, 4.1)."""

from midair.targets.compensation import precompensate, precompensate_sound
from midair.targets.cost import MappingReport, mapping_report
from midair.targets.decoupling import coupling, decouple
from midair.targets.interpolation import interpolation_matrix, moved_interpolation
from midair.targets.lead import led_in, piece_of, usual_lead, without_lead
from midair.targets.mapping import MAPPINGS, SlowBias, constant_offset, half_wave, mapping_of, slow_bias
from midair.targets.mapping_stream import MappingStream
from midair.targets.motion import Circle
from midair.targets.preparing import Interpolated, cells_of, prepare

__all__ = [
    "Circle",
    "Interpolated",
    "MAPPINGS",
    "MappingReport",
    "MappingStream",
    "SlowBias",
    "cells_of",
    "constant_offset",
    "coupling",
    "decouple",
    "half_wave",
    "interpolation_matrix",
    "led_in",
    "mapping_of",
    "mapping_report",
    "moved_interpolation",
    "piece_of",
    "precompensate",
    "precompensate_sound",
    "prepare",
    "slow_bias",
    "usual_lead",
    "without_lead",
]
