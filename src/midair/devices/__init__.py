"""Devices: the only files that touch hardware, and the virtual rig, which is a driver like any other."""

from midair.devices.arrays import (
    DEFAULT_PROFILE,
    Admission,
    BankedArray,
    Placement,
    SilencerChoice,
    admit,
    amplitude_of,
    autd3_array,
    autd3_firmware,
    choose_silencer,
    intensity_bytes,
    load_placement,
    phase_bytes,
    profile_named,
    pyautd3_array,
)
from midair.devices.interface import ArrayDevice, FrameBlock, PlayReport, SensorDevice
from midair.devices.reading import Seam
from midair.devices.sensors import Decimated, PacedSensor, ReplaySensor, Rewired, Source, Stream, StreamedSensor
from midair.devices.virtual import VirtualArray, VirtualSensor, VirtualSkin

__all__ = [
    "Admission",
    "ArrayDevice",
    "BankedArray",
    "DEFAULT_PROFILE",
    "Decimated",
    "FrameBlock",
    "PacedSensor",
    "Placement",
    "PlayReport",
    "ReplaySensor",
    "Rewired",
    "Seam",
    "SensorDevice",
    "SilencerChoice",
    "Source",
    "Stream",
    "StreamedSensor",
    "VirtualArray",
    "VirtualSensor",
    "VirtualSkin",
    "admit",
    "amplitude_of",
    "autd3_array",
    "autd3_firmware",
    "choose_silencer",
    "intensity_bytes",
    "load_placement",
    "phase_bytes",
    "profile_named",
    "pyautd3_array",
]
