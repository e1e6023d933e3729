"""Convert the pressure on a few cells to target sound amplitudes at the control points (paper, 4.1)."""

from midair.targets.compensation import precompensate, precompensate_sound
from midair.targets.cost import MappingReport, mapping_report
from midair.targets.decoupling import coupling, decouple
from midair.targets.interpolation import interpolation_matrix, moved_interpolation
from midair.targets.lead import add_lead, default_lead, frames_without_lead, remove_lead
from midair.targets.mapping import MAPPINGS, SlowBias, constant_offset, half_wave, mapping_of, slow_bias
from midair.targets.mapping_stream import MappingStream
from midair.targets.motion import Circle
from midair.targets.preparing import Interpolated, prepare, sensor_from_provenance

__all__ = [
    "Circle",
    "Interpolated",
    "MAPPINGS",
    "MappingReport",
    "MappingStream",
    "SlowBias",
    "sensor_from_provenance",
    "constant_offset",
    "coupling",
    "decouple",
    "half_wave",
    "interpolation_matrix",
    "add_lead",
    "mapping_of",
    "mapping_report",
    "moved_interpolation",
    "frames_without_lead",
    "precompensate",
    "precompensate_sound",
    "prepare",
    "slow_bias",
    "default_lead",
    "remove_lead",
]
