"""Devices: the only files that touch hardware, and the virtual rig, which is a driver like any other."""

from midair.devices.interface import ArrayDevice, Block, PlayReport, Progress, SensorDevice
from midair.devices.replay import ReplaySensor
from midair.devices.virtual_array import VirtualArray
from midair.devices.virtual_sensor import VirtualSensor
from midair.devices.virtual_skin import VirtualSkin

__all__ = [
    "ArrayDevice",
    "Block",
    "PlayReport",
    "Progress",
    "ReplaySensor",
    "SensorDevice",
    "VirtualArray",
    "VirtualSensor",
    "VirtualSkin",
]
