"""Physical models as pure functions: radiation pressure, propagation, transducers, sensors, exposure, skin."""

from midair.physics.cell_means import Between, cell_weights
from midair.physics.directivity import off_axis
from midair.physics.dynamics import TransducerDynamics, envelope
from midair.physics.exposure_level import Exposure, exposure, greatest_exposure, sound_level
from midair.physics.exposure_places import ExposureProfile, Place
from midair.physics.exposure_search import airs_of_room, searched_points
from midair.physics.field_error import printed_error, relative_error
from midair.physics.narrow_cone import cone_points
from midair.physics.playback import Spread, check_frame_rate, playback_response, simulate, steps_per_frame
from midair.physics.playback_chain import PlaybackChain, TransducerState, radiate
from midair.physics.propagation import (
    focus_amplitude,
    focus_phase,
    propagate,
    quantise_phase,
    transfer_matrix,
    wavenumber,
)
from midair.physics.radiation import radiation_pressure, sound_amplitude
from midair.physics.sensing import (
    SensorModel,
    calibration_of,
    cell_pressure,
    channel_response,
    sense,
    sensor_output,
)
from midair.physics.sensing_by_channel import channel_volts
from midair.physics.skin import SKINS, Tissue, skin_compliance
from midair.physics.skin_channels import TOUCH_CHANNELS, TouchChannel
from midair.physics.skin_motion import SkinMotion
from midair.physics.transducers import Transducers

__all__ = [
    "SKINS",
    "TOUCH_CHANNELS",
    "Between",
    "Exposure",
    "ExposureProfile",
    "TransducerState",
    "Place",
    "PlaybackChain",
    "SensorModel",
    "SkinMotion",
    "Spread",
    "Tissue",
    "TouchChannel",
    "TransducerDynamics",
    "Transducers",
    "calibration_of",
    "cell_weights",
    "channel_response",
    "channel_volts",
    "check_frame_rate",
    "cone_points",
    "airs_of_room",
    "searched_points",
    "envelope",
    "exposure",
    "cell_pressure",
    "greatest_exposure",
    "focus_amplitude",
    "focus_phase",
    "off_axis",
    "playback_response",
    "printed_error",
    "propagate",
    "quantise_phase",
    "radiate",
    "radiation_pressure",
    "relative_error",
    "sense",
    "simulate",
    "skin_compliance",
    "sound_amplitude",
    "sound_level",
    "sensor_output",
    "steps_per_frame",
    "transfer_matrix",
    "wavenumber",
]
