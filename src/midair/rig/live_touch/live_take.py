"""The take of a live run: the samples of the sensor and the emitted phases, with their settings."""

import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import MidairError
from midair.files import RecordingWriter
from midair.model import Event, EventKind, Placement, Provenance
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.process import LoopStarted
from midair.rig.live_touch.touch_ring import FRAME_LATE, FRAME_REPEATED


class LiveTake:
    """Writes the ring to a file in a thread of the parent program, so that no disk can delay the loop.

    `opened` is the state of the opened devices, `since` that of the loop's `TouchRing`, or as it for stored frames,
    called every `every` s; the ring holds several seconds. Raises FileError if the file cannot be created.
    """

    def __init__(
        self,
        path: Path,
        order: LiveSettings,
        opened: LoopStarted,
        since: Callable[[int], tuple[NDArray[Any], int, int]],
        notes: Mapping[str, str],
        *,
        every: float = 0.05,
    ) -> None:
        self.problem: MidairError | None = None
        self.missed = 0
        self._since, self._count, self._every = since, opened.sensor.count, every
        self._grid, self._seen, self._formed = opened.sensor, 0, opened.schedule.formed
        self._over = threading.Event()
        self._writer = RecordingWriter(
            path,
            rate=opened.rate,
            sensor=opened.sensor,
            unit=opened.unit,
            provenance=Provenance(source=order.sensor, simulated=opened.simulated, notes=dict(notes)).then(
                "live", _provenance(order, opened)
            ),
            calibration=opened.calibration,
            array=(order.placement or Placement.grid()).array(),
            played_each=self._formed,
        )
        self._writer.__enter__()

    def run(self) -> None:
        """Write until `end`, and then the remaining frames."""
        try:
            while not self._over.wait(self._every):
                self._write()
            self._write()
        except MidairError as wrong:
            self.problem = wrong

    def end(self) -> None:
        """Signal that no more frames follow."""
        self._over.set()

    def close(self) -> None:
        """Close the file, once `run` has returned; raise the error of the writing, if any."""
        self._writer.__exit__(None, self.problem, None)
        if self.problem is not None:
            raise self.problem

    def _write(self) -> None:
        found, seen, missed = self._since(self._seen)
        # Only whole frames of the sensor; the rest is read next time, or was overwritten in part.
        first = int(-found["number"][0]) % self._formed if len(found) else 0
        rest = (len(found) - first) % self._formed
        found, self._seen = found[first : len(found) - rest], seen - rest
        if missed := (missed + first) // self._formed:
            self._writer.note([Event(kind="lost", frame=self._writer.frames, frames=missed)])
            self.missed += missed
        if not len(found):
            return
        kinds: tuple[tuple[EventKind, int], ...] = (("lost", FRAME_REPEATED), ("late", FRAME_LATE))
        for kind, flag in kinds:
            for begin, end in _runs((found["flags"] & flag) > 0):
                first, last = begin // self._formed, -(-end // self._formed)
                self._writer.note([Event(kind=kind, frame=self._writer.frames + first, frames=last - first)])
        samples = found["samples"][:: self._formed, : self._count].reshape(-1, *self._grid.shape)
        played = {
            "phase_steps": found["phases"],
            "intensity": found["intensity"],
            "instant": found["instant"],
            "state": found["flags"].astype(np.int8),
        }
        self._writer.append(samples, played)


def _provenance(order: LiveSettings, opened: LoopStarted) -> dict[str, Any]:
    """Settings of the step "live" of a take."""
    medium, schedule = order.acoustics.medium, opened.schedule
    return {
        **{name: getattr(order, name) for name in ("device", "follow", "gain")},
        "height_m": order.height,
        "latency_s": order.latency,
        "offset_pa": order.offset,
        "band_hz": order.band,
        "hold_s": schedule.hold,
        "filter_delay_s": schedule.delay,
        "mapping": schedule.mapping,
        "delay_s": opened.delay,
        "level": opened.level,
        "exposure": opened.exposure,
        "silencer": opened.silencer,
        "error_by_band": opened.error,
        "computer": opened.granted,
        "array_calibration": opened.array_calibration,
        "sound_m_s": medium.speed,
        "temperature_c": medium.temperature,
        "humidity": medium.humidity,
        "air_stated": order.exposure.room is not None,
    }


def _runs(true: np.ndarray) -> list[tuple[int, int]]:
    """(first, one after the last) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]])))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]
