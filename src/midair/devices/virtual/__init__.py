"""The virtual rig: a simulated array, a simulated sensor and the simulated skin between them."""

from midair.devices.virtual.virtual_array import VirtualArray
from midair.devices.virtual.virtual_sensor import VirtualSensor
from midair.devices.virtual.virtual_skin import VirtualSkin
from midair.devices.virtual.virtual_units import VirtualUnits, virtual_immediate

__all__ = [
    "VirtualArray",
    "VirtualSensor",
    "VirtualSkin",
    "VirtualUnits",
    "virtual_immediate",
]
