"""Sensors: network streams, sound cards, converters, serial ports, and replayed files."""

from midair.devices.sensors.decimated import Decimated
from midair.devices.sensors.paced import PacedSensor
from midair.devices.sensors.remapped import RemappedSensor
from midair.devices.sensors.replay import ReplaySensor
from midair.devices.sensors.sources import Chunk, SensorOptions, Source, Stream
from midair.devices.sensors.streamed_sensor import StreamedSensor

__all__ = [
    "Chunk",
    "Decimated",
    "PacedSensor",
    "ReplaySensor",
    "RemappedSensor",
    "SensorOptions",
    "Source",
    "Stream",
    "StreamedSensor",
]
