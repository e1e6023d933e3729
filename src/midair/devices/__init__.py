"""Drivers of arrays, sensors and motion stages, real and virtual, and the exposure check."""

from typing import TYPE_CHECKING

from midair.lazy import lazy_names

if TYPE_CHECKING:
    from .arrays.autd3 import autd3_array as autd3_array
    from .arrays.autd3 import autd3_immediate as autd3_immediate
    from .arrays.autd3 import pyautd3_array as pyautd3_array
    from .arrays.immediate import ImmediateArray as ImmediateArray
    from .arrays.immediate import ImmediateUnits as ImmediateUnits
    from .arrays.immediate import Put as Put
    from .arrays.silencer import SilencerChoice as SilencerChoice
    from .arrays.silencer import silencer_named as silencer_named
    from .arrays.streaming import BankedArray as BankedArray
    from .exposure_check import ArrayInfo as ArrayInfo
    from .exposure_check import ExposureChoices as ExposureChoices
    from .exposure_check import ExposureClearance as ExposureClearance
    from .exposure_check import check_exposure as check_exposure
    from .exposure_check import check_exposure_level as check_exposure_level
    from .exposure_check import felt_pressure_text as felt_pressure_text
    from .exposure_check import measure_exposure as measure_exposure
    from .exposure_steered import SteeredClearance as SteeredClearance
    from .exposure_steered import check_exposure_steered as check_exposure_steered
    from .exposure_stream import ExposureStream as ExposureStream
    from .frame_bytes import PHASE_STEPS as PHASE_STEPS
    from .frame_bytes import TICK as TICK
    from .frame_bytes import amplitude_of as amplitude_of
    from .frame_bytes import divider as divider
    from .frame_bytes import intensity_bytes as intensity_bytes
    from .frame_bytes import phase_bytes as phase_bytes
    from .grbl import GrblStage as GrblStage
    from .interface import ArrayDevice as ArrayDevice
    from .interface import Cooling as Cooling
    from .interface import FrameBlock as FrameBlock
    from .interface import PlayReport as PlayReport
    from .interface import SensorDevice as SensorDevice
    from .reading import GapFiller as GapFiller
    from .reading import read_frames as read_frames
    from .safety.lock_files import append_line as append_line
    from .safety.lock_files import make_state_folder as make_state_folder
    from .safety.lock_files import state_folder as state_folder
    from .safety.play_lease import LeaseToken as LeaseToken
    from .safety.play_lease import PlayLease as PlayLease
    from .safety.play_lease import under_lease as under_lease
    from .safety.play_log import close_orders as close_orders
    from .safety.play_log import read_log as read_log
    from .safety.signals import END_SIGNALS as END_SIGNALS
    from .safety.signals import handle_signals as handle_signals
    from .safety.signals import signals_end_the_program as signals_end_the_program
    from .safety.stop_channel import Stopped as Stopped
    from .safety.stop_channel import ordered_at as ordered_at
    from .safety.stop_channel import playing_now as playing_now
    from .safety.stop_channel import process_start_time as process_start_time
    from .safety.stop_channel import stop_playing as stop_playing
    from .safety.stop_guard import device_lock as device_lock
    from .safety.stop_guard import open_stop_input as open_stop_input
    from .safety.stop_guard import stop_on_input as stop_on_input
    from .safety.stop_port import StopPort as StopPort
    from .sensors.decimated import Decimated as Decimated
    from .sensors.sources import Chunk as Chunk
    from .sensors.sources import SensorOptions as SensorOptions
    from .sensors.sources import Source as Source
    from .sensors.sources import Stream as Stream
    from .sensors.streamed_sensor import ReplaySensor as ReplaySensor
    from .sensors.streamed_sensor import StreamedSensor as StreamedSensor
    from .sensors.streamed_sensor import WrappedSensor as WrappedSensor
    from .trackers.osc import osc_messages as osc_messages
    from .trackers.prediction import DAMPED_VELOCITY as DAMPED_VELOCITY
    from .trackers.prediction import MotionModel as MotionModel
    from .trackers.prediction import PosePredictor as PosePredictor
    from .trackers.prediction import ReplaySource as ReplaySource
    from .trackers.tracker import RawPose as RawPose
    from .trackers.tracker import Tracker as Tracker
    from .trackers.tracker import TrackerOptions as TrackerOptions
    from .virtual.virtual_array import VirtualArray as VirtualArray
    from .virtual.virtual_array import VirtualSensor as VirtualSensor
    from .virtual.virtual_array import VirtualSkin as VirtualSkin
    from .virtual.virtual_array import VirtualUnits as VirtualUnits
    from .virtual.virtual_array import usual_transducers as usual_transducers
    from .virtual.virtual_array import virtual_immediate as virtual_immediate
else:
    __getattr__, __dir__ = lazy_names(__name__)
