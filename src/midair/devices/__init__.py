"""Drivers of arrays, sensors and motion stages, real and virtual, and the exposure check."""

from typing import TYPE_CHECKING

from midair.lazy import lazy_names

if TYPE_CHECKING:
    from .arrays import BankedArray as BankedArray
    from .arrays import ImmediateArray as ImmediateArray
    from .arrays import ImmediateUnits as ImmediateUnits
    from .arrays import Put as Put
    from .arrays import SilencerChoice as SilencerChoice
    from .arrays import autd3_array as autd3_array
    from .arrays import autd3_immediate as autd3_immediate
    from .arrays import pyautd3_array as pyautd3_array
    from .arrays import silencer_named as silencer_named
    from .exposure_check import ArrayInfo as ArrayInfo
    from .exposure_check import ExposureChoices as ExposureChoices
    from .exposure_check import ExposureClearance as ExposureClearance
    from .exposure_check import ExposureStream as ExposureStream
    from .exposure_check import check_exposure as check_exposure
    from .exposure_check import check_exposure_level as check_exposure_level
    from .exposure_check import check_exposure_steered as check_exposure_steered
    from .exposure_check import felt_pressure_text as felt_pressure_text
    from .exposure_check import measure_exposure as measure_exposure
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
    from .safety import END_SIGNALS as END_SIGNALS
    from .safety import LeaseToken as LeaseToken
    from .safety import PlayLease as PlayLease
    from .safety import Stopped as Stopped
    from .safety import StopPort as StopPort
    from .safety import append_line as append_line
    from .safety import close_orders as close_orders
    from .safety import device_lock as device_lock
    from .safety import handle_signals as handle_signals
    from .safety import make_state_folder as make_state_folder
    from .safety import open_stop_input as open_stop_input
    from .safety import ordered_at as ordered_at
    from .safety import playing_now as playing_now
    from .safety import process_start_time as process_start_time
    from .safety import read_log as read_log
    from .safety import signals_end_the_program as signals_end_the_program
    from .safety import state_folder as state_folder
    from .safety import stop_on_input as stop_on_input
    from .safety import stop_playing as stop_playing
    from .safety import under_lease as under_lease
    from .safety import uptime as uptime
    from .sensors import Chunk as Chunk
    from .sensors import Decimated as Decimated
    from .sensors import PacedSensor as PacedSensor
    from .sensors import RemappedSensor as RemappedSensor
    from .sensors import ReplaySensor as ReplaySensor
    from .sensors import SensorOptions as SensorOptions
    from .sensors import Source as Source
    from .sensors import Stream as Stream
    from .sensors import StreamedSensor as StreamedSensor
    from .sensors import WrappedSensor as WrappedSensor
    from .trackers import DAMPED_VELOCITY as DAMPED_VELOCITY
    from .trackers import MotionModel as MotionModel
    from .trackers import PosePredictor as PosePredictor
    from .trackers import RawPose as RawPose
    from .trackers import ReplaySource as ReplaySource
    from .trackers import Tracker as Tracker
    from .trackers import TrackerOptions as TrackerOptions
    from .trackers import osc_messages as osc_messages
    from .virtual import VirtualArray as VirtualArray
    from .virtual import VirtualSensor as VirtualSensor
    from .virtual import VirtualSkin as VirtualSkin
    from .virtual import VirtualUnits as VirtualUnits
    from .virtual import virtual_immediate as virtual_immediate
else:
    __getattr__, __dir__ = lazy_names(__name__)
