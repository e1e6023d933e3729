"""Convert recordings in V or counts to pressure in Pa within the sensor's band, and measure calibrations.

A calibration is measured against a reference (`measure_calibration`) or with a focused beam
(`midair.calibration.measure.beam`). `fit_array` measures the transducers of an array.
"""

from .inverse import CausalInverse as CausalInverse
from .inverse import causal_error as causal_error
from .inverse import causal_fir as causal_fir
from .inverse import inverse_response as inverse_response
from .inverse import undo_matrix as undo_matrix
from .measure.array_field import ArrayCodes as ArrayCodes
from .measure.array_field import ArrayField as ArrayField
from .measure.array_field import ArrayPlan as ArrayPlan
from .measure.array_field import SensorPlace as SensorPlace
from .measure.array_field import array_codes as array_codes
from .measure.array_fit import ArrayCheck as ArrayCheck
from .measure.array_fit import check_array as check_array
from .measure.array_fit import fit_array as fit_array
from .measure.beam import BeamPlan as BeamPlan
from .measure.beam import BeamReading as BeamReading
from .measure.beam import BeamSetting as BeamSetting
from .measure.beam import beam_field as beam_field
from .measure.beam import find_lag as find_lag
from .measure.beam import focus_position as focus_position
from .measure.beam import measure_beam as measure_beam
from .measure.beam import tone_amplitudes as tone_amplitudes
from .measure.frequency_response import known_noise as known_noise
from .measure.frequency_response import noise_equivalent_pressure as noise_equivalent_pressure
from .measure.group_fit import TransducerPrior as TransducerPrior
from .measure.referenced_take import Reference as Reference
from .measure.referenced_take import ReferencedTake as ReferencedTake
from .measure.referenced_take import noise_signal as noise_signal
from .measure.referenced_take import split_channel as split_channel
from .measure.referenced_take import sweep_signal as sweep_signal
from .measure.take_sums import MeasureSettings as MeasureSettings
from .measure.take_sums import measure_calibration as measure_calibration
from .measure.unit_poses import fit_tracker as fit_tracker
from .pressure import calibrate as calibrate
from .pressure import typical_uncertainty as typical_uncertainty
