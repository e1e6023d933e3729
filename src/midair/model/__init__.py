"""The nouns: frozen dataclasses on NumPy arrays that the stages hand to each other."""

from midair.model.calibration import Calibration
from midair.model.drive import Drive, Solution, Status
from midair.model.frames import AmplitudeFrames, PressureFrames
from midair.model.geometry import ControlGrid, SensorGrid, TransducerArray
from midair.model.medium import Medium
from midair.model.provenance import Provenance, Setting, Step
from midair.model.recording import Recording, Unit

__all__ = [
    "AmplitudeFrames",
    "Calibration",
    "ControlGrid",
    "Drive",
    "Medium",
    "PressureFrames",
    "Provenance",
    "Recording",
    "SensorGrid",
    "Setting",
    "Solution",
    "Status",
    "Step",
    "TransducerArray",
    "Unit",
]
