"""Measure a calibration against a reference, with a tone of known pressure, or with a focused beam."""

from midair.calibration.measure.against_reference import measure_calibration, measure_response
from midair.calibration.measure.array_field import ArrayField, SensorPlace
from midair.calibration.measure.array_fit import fit_array
from midair.calibration.measure.array_plan import ArrayCodes, ArrayPlan, array_codes
from midair.calibration.measure.beam import BeamReading, find_lag, measure_beam, tone_amplitudes
from midair.calibration.measure.beam_plan import BeamPlan, BeamSetting, beam_field, focus_position
from midair.calibration.measure.excitation import noise_signal, sweep_signal
from midair.calibration.measure.frequency_response import FrequencyResponse
from midair.calibration.measure.microphone_scale import MicrophoneScale, scale_of_drop, scale_of_tone
from midair.calibration.measure.noise import noise_equivalent_pressure
from midair.calibration.measure.referenced_take import Reference, ReferencedTake, split_channel
from midair.calibration.measure.shared_parameters import TransducerPrior
from midair.calibration.measure.take_sums import MeasureSettings
from midair.calibration.measure.tone import measure_tone, scale_to_tone

__all__ = [
    "MicrophoneScale",
    "scale_of_drop",
    "scale_of_tone",
    "ArrayCodes",
    "ArrayField",
    "ArrayPlan",
    "BeamPlan",
    "BeamReading",
    "BeamSetting",
    "FrequencyResponse",
    "MeasureSettings",
    "Reference",
    "ReferencedTake",
    "SensorPlace",
    "TransducerPrior",
    "scale_to_tone",
    "array_codes",
    "beam_field",
    "find_lag",
    "fit_array",
    "focus_position",
    "measure_beam",
    "measure_calibration",
    "measure_response",
    "measure_tone",
    "noise_equivalent_pressure",
    "noise_signal",
    "split_channel",
    "sweep_signal",
    "tone_amplitudes",
]
