"""Poses of a stream of the Lab Streaming Layer; needs the extra `lsl`."""

import time
from dataclasses import dataclass

import pylsl
from pylsl.util import LostError, TimeoutError

from midair.devices.liblsl import quiet_liblsl
from midair.devices.trackers.tracker import RawPose, TrackerOptions
from midair.errors import DeviceError
from midair.validation import setting


class LslPoses:
    """A stream with 9 or 10 channels: centre in m, normal, direction of the fingers, and confidence."""

    host_clock = True

    def __init__(self, stream: str, search: float) -> None:
        self._stream, self._search = stream, search
        self._inlet: pylsl.StreamInlet | None = None

    def open(self) -> None:
        """Find the stream and connect to its sender."""
        quiet_liblsl()
        found = pylsl.resolve_byprop("name", self._stream, 1, self._search)
        if not found:
            raise DeviceError(
                f"lsl:{self._stream}: expected a stream of this name, found none in {self._search:g} s; start its "
                "sender in the same network"
            )
        channels, text = found[0].channel_count(), found[0].channel_format() == pylsl.cf_string
        if text or channels not in (9, 10):
            raise DeviceError(
                f"lsl:{self._stream}: expected 9 or 10 numbers (centre in m, normal, fingers, confidence), got "
                f"{channels} channels{' of text' if text else ''}"
            )
        inlet = pylsl.StreamInlet(found[0], recover=False, processing_flags=pylsl.proc_clocksync)
        try:
            inlet.open_stream(timeout=self._search)
            inlet.time_correction(timeout=self._search)
        except (LostError, TimeoutError) as wrong:
            raise self._lost() from wrong
        self._inlet = inlet

    def pull(self, wait: float) -> list[RawPose | str]:
        """Poses that have arrived."""
        if self._inlet is None:
            raise DeviceError(f"lsl:{self._stream}: expected open first")
        try:
            rows, stamps = self._inlet.pull_chunk(timeout=wait, max_samples=64, min_samples=1)
        except LostError as wrong:
            raise self._lost() from wrong
        offset = time.monotonic() - pylsl.local_clock()
        return [
            RawPose(stamp=stamp + offset, values=row[:9], confidence=row[9] if len(row) > 9 else 1.0)
            for row, stamp in zip(rows or [], stamps, strict=True)
        ]

    def close(self) -> None:
        """Disconnect from the sender."""
        self._inlet = None

    def _lost(self) -> DeviceError:
        return DeviceError(f"lsl:{self._stream}: lost the sender of the stream; start it again")


@dataclass(frozen=True, kw_only=True)
class LslTracker(TrackerOptions):
    """Kind ``lsl:NAME``; `search` limits the time to find the stream, in s."""

    search: float = setting(5.0, "Longest time to find the stream.", unit="s", limits=(0, 3600), above=True)

    def source(self, place: str) -> LslPoses:
        """Stream of a name."""
        return LslPoses(place, self.search)
