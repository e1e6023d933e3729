"""Trackers of the palm: the interface, its checks, and replayed poses."""

from .replay import ReplaySource as ReplaySource
from .tracker import PoseSource as PoseSource
from .tracker import RawPose as RawPose
from .tracker import Tracker as Tracker
from .tracker import TrackerOptions as TrackerOptions
from .tracker import TrackerStatus as TrackerStatus
