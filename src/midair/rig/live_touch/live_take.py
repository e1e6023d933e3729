"""Take of a live run: the sensor's samples and, for each frame, the emitted phases, written while it runs."""

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from midair.errors import MidairError
from midair.files import RecordingWriter
from midair.model import Event, EventKind, Placement, Provenance
from midair.rig.live_touch.live_settings import LiveSettings
from midair.rig.live_touch.process import LoopStarted
from midair.rig.live_touch.touch_ring import FRAME_LATE, FRAME_REPEATED


class TouchFrames(Protocol):
    """Source of the frames of a take."""

    def since(self, seen: int) -> tuple[NDArray[Any], int, int]:
        """As `TouchRing.since`."""
        ...


class LiveTake:
    """Writes the ring to a file in a thread of the parent program, so that no disk can delay the loop.

    `opened` is the state of the opened devices, `ring` the ring of the loop, or stored frames of it,
    which is read every `every` s; the ring holds several seconds. Raises FileError if the file cannot be created.
    """

    def __init__(
        self,
        path: Path,
        order: LiveSettings,
        opened: LoopStarted,
        ring: TouchFrames,
        notes: Mapping[str, str],
        *,
        every: float = 0.05,
    ) -> None:
        self.problem: MidairError | None = None
        self.missed = 0
        self._ring, self._count, self._every = ring, opened.sensor.count, every
        self._grid, self._seen = opened.sensor, 0
        self._over = threading.Event()
        self._writer = RecordingWriter(
            path,
            rate=opened.rate,
            sensor=opened.sensor,
            unit=opened.unit,
            provenance=_provenance(order, opened, notes),
            calibration=opened.calibration,
            array=(order.placement or Placement.grid()).array(),
        )
        self._writer.__enter__()

    @property
    def frames(self) -> int:
        """Number of frames in the file."""
        return self._writer.frames

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
        found, self._seen, missed = self._ring.since(self._seen)
        if missed:
            self._writer.note([Event(kind="lost", frame=self._writer.frames, frames=missed)])
            self.missed += missed
        if not len(found):
            return
        kinds: tuple[tuple[EventKind, int], ...] = (("lost", FRAME_REPEATED), ("late", FRAME_LATE))
        for kind, flag in kinds:
            for begin, end in _runs((found["flags"] & flag) > 0):
                self._writer.note([Event(kind=kind, frame=self._writer.frames + begin, frames=end - begin)])
        samples = found["samples"][:, : self._count].reshape(-1, *self._grid.shape)
        played = {
            "phase_steps": found["phases"],
            "intensity": found["intensity"],
            "instant": found["instant"],
            "state": found["flags"].astype(np.int8),
        }
        self._writer.append(samples, played)


def _runs(true: np.ndarray) -> list[tuple[int, int]]:
    """(first, one after the last) of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]])))
    return [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2], strict=True)]


def _provenance(order: LiveSettings, opened: LoopStarted, notes: Mapping[str, str]) -> Provenance:
    return Provenance(source=order.source, simulated=opened.simulated, notes=dict(notes)).then(
        "live",
        order.stored()
        | {
            "delay_s": opened.delay,
            "level": opened.level,
            "exposure": opened.exposure,
            "silencer": opened.silencer,
            "error_by_band": opened.error,
            "computer": opened.granted.words(),
            "array_calibration": opened.array_calibration,
        },
    )
