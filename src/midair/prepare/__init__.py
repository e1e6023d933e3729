"""From pressure on a few cells to the sound amplitude wanted at the control points (paper, 4.1)."""

from midair.prepare.compensation import precompensate, precompensate_sound
from midair.prepare.cost import MappingReport, mapping_report
from midair.prepare.decoupling import coupling, decouple
from midair.prepare.interpolation import interpolation_matrix, moved_interpolation
from midair.prepare.mapping import MAPPINGS, SlowBias, constant_offset, half_wave, slow_bias
from midair.prepare.motion import Circle
from midair.prepare.stage import Interpolated, prepare
from midair.prepare.streaming import MappingStream

__all__ = [
    "MAPPINGS",
    "Circle",
    "Interpolated",
    "MappingReport",
    "MappingStream",
    "SlowBias",
    "constant_offset",
    "coupling",
    "decouple",
    "half_wave",
    "interpolation_matrix",
    "mapping_report",
    "moved_interpolation",
    "precompensate",
    "precompensate_sound",
    "prepare",
    "slow_bias",
]
