"""Strokes of an object over the sensor by a motion stage, one during each take."""

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Self

from midair.devices import GrblStage
from midair.errors import MidairError
from midair.model import Place, Setting, StageSetup, StageStamp

Stopped = Callable[[], bool]


class StageStrokes:
    """Strokes of `length` m at `speed` m/s by a stage, which is open inside the block.

    During a take its thread appends to `stamps`, positions at times of this computer's monotonic clock, and to
    `strokes`, the (start, end) of each stroke, complete or not; then `over` ends the take, and `problem` is the message
    of an error. A motion ends early as soon as `stopped` returns True.
    """

    def __init__(self, stage: GrblStage, setup: StageSetup, *, length: float, speed: float) -> None:
        self.stage, self.setup, self.length, self.speed = stage, setup, length, speed
        self.stopped: Stopped = lambda: False
        self.stamps, self.strokes = deque[StageStamp](), deque[tuple[float, float]]()
        self.over, self.problem = False, ""
        self._enough, self._thread = threading.Event(), threading.Thread()

    def __enter__(self) -> Self:
        self.stage.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self.stage.__exit__(*error)

    @property
    def seconds(self) -> float:
        """Estimated time of a stroke with the way down and up, plus a second for acceleration."""
        down = self.setup.clear - self.setup.contact
        return down / self.setup.approach + self.length / self.speed + down / self.setup.back + 1.0

    @property
    def settings(self) -> dict[str, Setting]:
        """The request, for the provenance."""
        setup = self.setup
        return {
            "stage": self.stage.name,
            "firmware": self.stage.firmware,
            "stroke_m": self.length,
            "speed_m_s": self.speed,
            "heading": setup.heading,
            "start_m": setup.start,
            "contact_m": setup.contact,
            "clear_m": setup.clear,
            "approach_m_s": setup.approach,
            "return_m_s": setup.back,
        }

    def plan(self, repeats: int) -> str:
        """The planned movement in words, once the machine is ready and reaches the speed; otherwise its error."""
        stage, setup = self.stage, self.setup
        stage.ready(homing=setup.homing == "switches")
        stage.check_speed(self.speed, self.length, "xyz".index(setup.heading[1]))
        origin = "its switches" if setup.homing == "switches" else "where it was set by hand"
        (x, y), contact, clear = (1e3 * part for part in setup.start), 1e3 * setup.contact, 1e3 * setup.clear
        return (
            f"stage {stage.name}, {stage.firmware}, at {stage.stands} by {origin}\n"
            f"it will move: over x {x:g}, y {y:g} mm at z {clear:g} mm; then {repeats} x down to z {contact:g} mm at "
            f"{1e3 * setup.approach:g} mm/s, {1e3 * self.length:g} mm along {setup.heading} at {1e3 * self.speed:g} "
            f"mm/s, up and back at {1e3 * setup.back:g} mm/s; Ctrl-C holds it"
        )

    def to_start(self, stopped: Stopped) -> bool:
        """Rise clear of the sensor, and move above the start of a stroke; return False if it was stopped."""
        x, y, z = self.stage.ready(homing=self.setup.homing == "switches").position
        height = max(z, self.setup.clear)
        way = (x, y, height), (*self.setup.start, height), self.setup.above
        return all(self.stage.move(to, self.setup.back, stamp=bool, stopped=stopped) is not None for to in way)

    def begin(self) -> None:
        """Start a stroke; the first frame is in the file."""
        self._enough.clear()
        self.over, self.problem = False, ""
        self._thread = threading.Thread(target=self._run, name="stroke", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Stop the stage if it moves, and wait until it stands still; allowed at any time and repeatedly."""
        self._enough.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        setup, end = self.setup, self.setup.end(self.length)
        try:
            if self._move((*setup.start, setup.contact), setup.approach) is None:
                return
            begun, times = time.monotonic(), None
            try:
                times = self._move(end, self.speed)
            finally:
                self.strokes.append(times or (begun, time.monotonic()))
            if times is not None:
                self._move((end[0], end[1], setup.clear), setup.back)
        except MidairError as wrong:
            self.problem = str(wrong)
        finally:
            self.over = True

    def _move(self, target: Place, speed: float) -> tuple[float, float] | None:
        return self.stage.move(
            target, speed, stamp=self.stamps.append, stopped=lambda: self._enough.is_set() or self.stopped()
        )
