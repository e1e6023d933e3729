"""Data classes that the stages exchange: frozen dataclasses that hold read-only NumPy arrays."""

from midair.model.acoustics import Acoustics, Directivity
from midair.model.array_calibration import ArrayCalibration
from midair.model.board import Board, array_of_boards
from midair.model.calibration import Calibration
from midair.model.drive import Drive, PlayedTouch, Solution, Status
from midair.model.frames import AmplitudeFrames, PressureFrames
from midair.model.geometry import ControlGrid, SensorGrid, TransducerArray
from midair.model.measurement import Crosstalk, Linearity, Measurement
from midair.model.medium import Medium
from midair.model.palm import Palm
from midair.model.placement import UNIT, Placement
from midair.model.provenance import Provenance, Setting, Step
from midair.model.recording import Recording, Unit
from midair.model.recording_events import Event, EventKind
from midair.model.stage import Heading, Place, StageSetup, StageStamp, check_reached, speed_of
from midair.model.wiring import SensorWiring
from midair.progress import Progress

__all__ = [
    "ArrayCalibration",
    "Acoustics",
    "AmplitudeFrames",
    "Board",
    "Calibration",
    "ControlGrid",
    "Crosstalk",
    "Directivity",
    "Drive",
    "Event",
    "EventKind",
    "Heading",
    "Linearity",
    "Measurement",
    "Medium",
    "PressureFrames",
    "UNIT",
    "Placement",
    "PlayedTouch",
    "Palm",
    "Place",
    "Progress",
    "Provenance",
    "Recording",
    "SensorGrid",
    "SensorWiring",
    "Setting",
    "Solution",
    "StageSetup",
    "StageStamp",
    "Status",
    "Step",
    "TransducerArray",
    "Unit",
    "array_of_boards",
    "check_reached",
    "speed_of",
]
