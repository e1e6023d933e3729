"""Trackers of the palm: the interface, its checks, prediction, and replayed poses."""

from .osc import osc_messages as osc_messages
from .prediction import DAMPED_VELOCITY as DAMPED_VELOCITY
from .prediction import MotionModel as MotionModel
from .prediction import PosePredictor as PosePredictor
from .prediction import ReplaySource as ReplaySource
from .tracker import RawPose as RawPose
from .tracker import Tracker as Tracker
from .tracker import TrackerOptions as TrackerOptions
