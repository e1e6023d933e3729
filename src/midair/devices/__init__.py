"""Devices: the only files that touch hardware, and the virtual rig, which is a driver like any other."""

from midair.devices.autd3 import autd3_array, autd3_firmware, pyautd3_array
from midair.devices.banked_array import BankedArray
from midair.devices.interface import ArrayDevice, Block, PlayReport, Progress, SensorDevice
from midair.devices.placement import Placement, load_placement
from midair.devices.replay import ReplaySensor
from midair.devices.rewired import Rewired
from midair.devices.silencer import SilencerChoice
from midair.devices.streamed_sensor import StreamedSensor
from midair.devices.virtual_array import VirtualArray
from midair.devices.virtual_sensor import VirtualSensor
from midair.devices.virtual_skin import VirtualSkin

__all__ = [
    "ArrayDevice",
    "BankedArray",
    "Block",
    "Placement",
    "PlayReport",
    "Progress",
    "ReplaySensor",
    "Rewired",
    "SensorDevice",
    "SilencerChoice",
    "StreamedSensor",
    "VirtualArray",
    "VirtualSensor",
    "VirtualSkin",
    "autd3_array",
    "autd3_firmware",
    "load_placement",
    "pyautd3_array",
]
