"""Devices: the only files that touch hardware, and the virtual rig, which is a driver like any other."""

from midair.devices.admission import Admission, ExposureChoices, admit, admit_level, admit_parts, feeling, measure
from midair.devices.arrays import (
    BankedArray,
    OpenMpdArray,
    SilencerChoice,
    autd3_array,
    autd3_firmware,
    autd3_standing,
    choose_silencer,
    pyautd3_array,
)
from midair.devices.frame_bytes import amplitude_of, intensity_bytes, phase_bytes
from midair.devices.interface import ArrayDevice, FrameBlock, PlayReport, SensorDevice
from midair.devices.reading import Seam, gapless, read_frames
from midair.devices.safety import (
    Stopped,
    device_lock,
    make_state_folder,
    ordered_at,
    playing_now,
    process_began,
    state_folder,
    stop_playing,
    uptime,
)
from midair.devices.sensors import Decimated, PacedSensor, ReplaySensor, Rewired, Source, Stream, StreamedSensor
from midair.devices.stages import StageDevice
from midair.devices.virtual import VirtualArray, VirtualSensor, VirtualSkin

__all__ = [
    "Admission",
    "ArrayDevice",
    "BankedArray",
    "Decimated",
    "FrameBlock",
    "OpenMpdArray",
    "PacedSensor",
    "PlayReport",
    "ReplaySensor",
    "Rewired",
    "Seam",
    "SensorDevice",
    "SilencerChoice",
    "Source",
    "StageDevice",
    "Stream",
    "Stopped",
    "StreamedSensor",
    "VirtualArray",
    "VirtualSensor",
    "VirtualSkin",
    "admit",
    "admit_level",
    "admit_parts",
    "ExposureChoices",
    "amplitude_of",
    "feeling",
    "measure",
    "autd3_array",
    "autd3_firmware",
    "autd3_standing",
    "choose_silencer",
    "gapless",
    "intensity_bytes",
    "phase_bytes",
    "read_frames",
    "pyautd3_array",
    "device_lock",
    "make_state_folder",
    "ordered_at",
    "playing_now",
    "process_began",
    "state_folder",
    "stop_playing",
    "uptime",
]
