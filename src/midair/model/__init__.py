"""Data classes that the stages exchange: frozen dataclasses that hold read-only NumPy arrays."""

from dataclasses import is_dataclass

from midair.progress import Progress as Progress
from midair.validation import check_calls

from .calibration import POSE_AIMS as POSE_AIMS
from .calibration import ArrayCalibration as ArrayCalibration
from .calibration import Calibration as Calibration
from .calibration import Crosstalk as Crosstalk
from .calibration import Linearity as Linearity
from .calibration import Measurement as Measurement
from .drive import Drive as Drive
from .drive import PlayedTouch as PlayedTouch
from .drive import Solution as Solution
from .drive import Status as Status
from .geometry import BAND as BAND
from .geometry import HEIGHT as HEIGHT
from .geometry import HEIGHTS as HEIGHTS
from .geometry import RATE as RATE
from .geometry import UNIT as UNIT
from .geometry import ControlGrid as ControlGrid
from .geometry import Placement as Placement
from .geometry import SensorGrid as SensorGrid
from .geometry import TransducerArray as TransducerArray
from .medium import Acoustics as Acoustics
from .medium import Directivity as Directivity
from .medium import Medium as Medium
from .palm import Palm as Palm
from .palm import PalmPath as PalmPath
from .palm import TrackerPlacement as TrackerPlacement
from .provenance import Provenance as Provenance
from .provenance import Setting as Setting
from .provenance import Step as Step
from .provenance import frames_without_lead as frames_without_lead
from .recording import AmplitudeFrames as AmplitudeFrames
from .recording import Event as Event
from .recording import EventKind as EventKind
from .recording import PressureFrames as PressureFrames
from .recording import Recording as Recording
from .recording import SensorWiring as SensorWiring
from .recording import Unit as Unit
from .recording import frame_range as frame_range
from .recording import known_unit as known_unit
from .shown import Shown as Shown
from .stage import Heading as Heading
from .stage import Place as Place
from .stage import StageSetup as StageSetup
from .stage import StageStamp as StageStamp
from .stage import speed_of as speed_of

for _kind in [Shown, *(each for each in globals().values() if is_dataclass(each))]:
    check_calls(_kind)
