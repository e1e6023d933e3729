"""Convert the pressure on a few cells to target sound amplitudes at the control points (paper, 4.1)."""

from .mapping import MAPPINGS as MAPPINGS
from .mapping import MappingStream as MappingStream
from .mapping import SlowBias as SlowBias
from .mapping import add_lead as add_lead
from .mapping import constant_offset as constant_offset
from .mapping import default_lead as default_lead
from .mapping import half_wave as half_wave
from .mapping import mapping_of as mapping_of
from .mapping import precompensate as precompensate
from .mapping import precompensate_sound as precompensate_sound
from .mapping import remove_lead as remove_lead
from .mapping import slow_bias as slow_bias
from .preparing import Circle as Circle
from .preparing import Interpolated as Interpolated
from .preparing import coupling as coupling
from .preparing import decouple as decouple
from .preparing import interpolation_matrix as interpolation_matrix
from .preparing import moved_interpolation as moved_interpolation
from .preparing import prepare as prepare
from .preparing import sensor_from_provenance as sensor_from_provenance
from .receptors import PACINIAN as PACINIAN
from .receptors import receptor_levels as receptor_levels
from .receptors import receptor_pressure as receptor_pressure
from .receptors import receptors as receptors
