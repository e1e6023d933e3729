"""Devices: the only files that touch hardware, and the virtual rig, which is a driver like any other."""

from midair.devices.arrays.autd3 import autd3_array, autd3_firmware, pyautd3_array
from midair.devices.arrays.banked_array import BankedArray
from midair.devices.arrays.placement import Placement, load_placement
from midair.devices.arrays.silencer import SilencerChoice
from midair.devices.interface import ArrayDevice, Block, PlayReport, Progress, SensorDevice
from midair.devices.sensors.replay import ReplaySensor
from midair.devices.sensors.rewired import Rewired
from midair.devices.sensors.streamed_sensor import StreamedSensor
from midair.devices.virtual.virtual_array import VirtualArray
from midair.devices.virtual.virtual_sensor import VirtualSensor
from midair.devices.virtual.virtual_skin import VirtualSkin

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
