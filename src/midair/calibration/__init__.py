"""Convert recordings in V or counts to pressure in Pa within the sensor's band, and measure calibrations.

A calibration is measured against a reference (`measure_calibration`) or with a focused beam
(`midair.calibration.measure.beam`). `fit_array` measures the transducers of an array.
"""

from .inverse import CausalInverse as CausalInverse
from .inverse import causal_error as causal_error
from .inverse import causal_fir as causal_fir
from .inverse import default_taps as default_taps
from .inverse import inverse_fir as inverse_fir
from .inverse import inverse_response as inverse_response
from .inverse import undo_matrix as undo_matrix
from .measure import ArrayCheck as ArrayCheck
from .measure import ArrayCodes as ArrayCodes
from .measure import ArrayField as ArrayField
from .measure import ArrayPlan as ArrayPlan
from .measure import BeamPlan as BeamPlan
from .measure import BeamReading as BeamReading
from .measure import BeamSetting as BeamSetting
from .measure import MeasureSettings as MeasureSettings
from .measure import MicrophoneScale as MicrophoneScale
from .measure import Reference as Reference
from .measure import ReferencedTake as ReferencedTake
from .measure import SensorPlace as SensorPlace
from .measure import TransducerPrior as TransducerPrior
from .measure import array_codes as array_codes
from .measure import beam_field as beam_field
from .measure import check_array as check_array
from .measure import find_lag as find_lag
from .measure import fit_array as fit_array
from .measure import fit_tracker as fit_tracker
from .measure import focus_position as focus_position
from .measure import known_noise as known_noise
from .measure import measure_beam as measure_beam
from .measure import measure_calibration as measure_calibration
from .measure import noise_equivalent_pressure as noise_equivalent_pressure
from .measure import noise_signal as noise_signal
from .measure import scale_of_drop as scale_of_drop
from .measure import scale_of_tone as scale_of_tone
from .measure import split_channel as split_channel
from .measure import sweep_signal as sweep_signal
from .measure import tone_amplitudes as tone_amplitudes
from .pressure import Method as Method
from .pressure import calibrate as calibrate
from .pressure import typical_uncertainty as typical_uncertainty
