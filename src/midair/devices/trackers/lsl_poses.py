"""Poses of a stream of the Lab Streaming Layer; needs the extra `lsl`."""

import time

import pylsl
from pydantic import PositiveFloat
from pylsl.util import LostError

from midair.devices.liblsl import inlet_of_numbers
from midair.devices.trackers.tracker import RawPose, TrackerOptions
from midair.errors import DeviceError


class LslPoses:
    """A stream with 9 or 10 channels: centre in m, normal, direction of the fingers, and confidence."""

    host_clock = True

    def __init__(self, stream: str, search: float) -> None:
        self._stream, self._search = stream, search
        self._inlet: pylsl.StreamInlet | None = None

    def open(self) -> None:
        """Find the stream and connect to its sender."""
        inlet = inlet_of_numbers(self._stream, f"lsl:{self._stream}", self._search)
        channels = inlet.channel_count
        if channels not in (9, 10):
            raise DeviceError(
                f"lsl:{self._stream}: expected 9 or 10 channels (centre in m, normal, fingers, "
                f"confidence), got {channels}"
            )
        self._inlet = inlet

    def pull(self, wait: float) -> list[RawPose | str]:
        """Poses that have arrived."""
        if self._inlet is None:
            raise DeviceError(f"lsl:{self._stream}: expected open first")
        try:
            rows, stamps = self._inlet.pull_chunk(timeout=wait, max_samples=64, min_samples=1)
        except LostError as wrong:
            raise DeviceError(f"lsl:{self._stream}: lost the sender of the stream; start it again") from wrong
        offset = time.monotonic() - pylsl.local_clock()
        return [
            RawPose(stamp=stamp + offset, values=row[:9], confidence=row[9] if len(row) > 9 else 1.0)
            for row, stamp in zip(rows or [], stamps, strict=True)
        ]

    def close(self) -> None:
        """Disconnect from the sender."""
        self._inlet = None


class LslTracker(TrackerOptions):
    """Kind ``lsl:NAME``; `search` limits the time to find the stream, in s."""

    search: PositiveFloat = 5.0

    def source(self, place: str) -> LslPoses:
        """Stream of a name."""
        return LslPoses(place, self.search)
