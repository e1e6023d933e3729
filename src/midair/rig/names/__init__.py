"""Make devices from the names that users type, and the virtual rig."""

from midair.rig.names.array_names import ArrayKind, array_named, array_of_kind
from midair.rig.names.sensor_names import sensor_named
from midair.rig.names.source_names import SENSORS, source_sensor
from midair.rig.names.stage_names import stage_named
from midair.rig.names.virtual_rig import VirtualRig

__all__ = [
    "ArrayKind",
    "SENSORS",
    "VirtualRig",
    "array_named",
    "array_of_kind",
    "sensor_named",
    "source_sensor",
    "stage_named",
]
