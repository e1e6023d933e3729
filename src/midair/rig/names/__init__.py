"""Open: from the names that people type to devices, and the virtual rig."""

from midair.rig.names.array_names import array_named
from midair.rig.names.sensor_names import sensor_named
from midair.rig.names.source_names import KINDS, source_module, source_sensor
from midair.rig.names.virtual_rig import VirtualRig

__all__ = [
    "KINDS",
    "VirtualRig",
    "array_named",
    "sensor_named",
    "source_module",
    "source_sensor",
]
