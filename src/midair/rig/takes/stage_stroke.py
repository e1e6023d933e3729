"""One stroke of a motion stage during a take: down to the sensor, along it, up again, in a separate thread."""

import threading
import time
from collections.abc import Callable

from midair.devices import StageDevice
from midair.errors import MidairError
from midair.model import Place, StageSetup, StageStamp
from midair.rig.takes.take_state import CompanionReport


class StageStroke:
    """Companion of a take that strokes an object over the sensor once; length in m, speed in m/s.

    The stage is open, at rest above the start of the stroke; it stops when `stopped` returns True.
    """

    def __init__(
        self, stage: StageDevice, setup: StageSetup, *, stroke: float, speed: float, stopped: Callable[[], bool]
    ) -> None:
        self._stage, self._setup, self._stroke, self._speed = stage, setup, stroke, speed
        self._asked_to_stop = stopped
        self._lock, self._enough = threading.Lock(), threading.Event()
        self._stamps: list[StageStamp] = []
        self._strokes: list[tuple[float, float]] = []
        self._over, self._problem = False, ""
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """Start the stroke."""
        self._thread = threading.Thread(target=self._run, name="stroke", daemon=True)
        self._thread.start()

    def news(self) -> CompanionReport:
        """Report since the last call."""
        with self._lock:
            stamps, self._stamps = tuple(self._stamps), []
            strokes, self._strokes = tuple(self._strokes), []
            return CompanionReport(stamps=stamps, strokes=strokes, over=self._over, problem=self._problem)

    def end(self) -> None:
        """Stop the stage if it moves, and wait until it stands still."""
        self._enough.set()
        if self._thread is not None:
            self._thread.join()

    def _run(self) -> None:
        problem = ""
        try:
            self._stroke_once()
        except MidairError as wrong:
            problem = str(wrong)
        with self._lock:
            self._over, self._problem = True, problem

    def _stroke_once(self) -> None:
        x, y = self._setup.start
        end = self._setup.end(self._stroke)
        if self._move((x, y, self._setup.contact), self._setup.approach) is None:
            return
        begun = time.monotonic()
        times = None
        try:
            times = self._move(end, self._speed)
        finally:
            with self._lock:
                self._strokes.append(times or (begun, time.monotonic()))
        if times is not None:
            self._move((end[0], end[1], self._setup.clear), self._setup.back)

    def _move(self, target: Place, speed: float) -> tuple[float, float] | None:
        return self._stage.move(target, speed, stamp=self._keep, stopped=self._stop)

    def _keep(self, stamp: StageStamp) -> None:
        with self._lock:
            self._stamps.append(stamp)

    def _stop(self) -> bool:
        return self._enough.is_set() or self._asked_to_stop()


def move_to_start(stage: StageDevice, setup: StageSetup, here: Place, stopped: Callable[[], bool]) -> bool:
    """Raise the stage clear of the sensor and move it above the start of a stroke; return False if it was stopped."""
    height = max(here[2], setup.clear)
    for target in ((here[0], here[1], height), (*setup.start, height), setup.above):
        if stage.move(target, setup.back, stamp=lambda _: None, stopped=stopped) is None:
            return False
    return True
