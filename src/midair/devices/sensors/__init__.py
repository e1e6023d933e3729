"""Sensors: network streams, sound cards, converters, serial ports, and replayed files."""

from .decimated import Decimated as Decimated
from .sources import Chunk as Chunk
from .sources import SensorOptions as SensorOptions
from .sources import Source as Source
from .sources import Stream as Stream
from .streamed_sensor import PacedSensor as PacedSensor
from .streamed_sensor import RemappedSensor as RemappedSensor
from .streamed_sensor import ReplaySensor as ReplaySensor
from .streamed_sensor import StreamedSensor as StreamedSensor
from .streamed_sensor import WrappedSensor as WrappedSensor
