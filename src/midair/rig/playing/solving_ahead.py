"""Solve a pressure in a thread while an array plays it: every part is checked ahead of its sound."""

import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from midair.array_types import Array
from midair.devices import (
    PHASE_STEPS,
    ArrayDevice,
    ExposureChoices,
    ExposureClearance,
    ExposureStream,
    measure_exposure,
)
from midair.errors import InputError, StoppedError
from midair.files import save_solutions
from midair.model import Drive, PressureFrames, Solution, TransducerArray
from midair.pipeline import reproduce_stream
from midair.settings import Settings
from midair.solvers import frames_per_part, one_blas_thread

RESERVE = 0.3
"""Time by which frames are ready before they sound, in s: the units need a tenth, the computer is not always free."""
SLOWER = 1.2
"""Factor by which the rest may take longer than measured."""


class SolvedAhead(threading.Thread):
    """Solves a pressure for an array, part by part, and checks each part; made by `solved_ahead`."""

    def __init__(
        self,
        pressure: PressureFrames,
        transducers: TransducerArray,
        device: ArrayDevice,
        settings: Settings,
        choices: ExposureChoices,
        *,
        repeats: int,
        path: Path | None,
    ) -> None:
        super().__init__(name="midair solver", daemon=True)
        self._pressure, self._transducers, self._device = pressure, transducers, device
        self._settings, self._choices, self._repeats, self._path = settings, choices, repeats, path
        self._news, self._ends = threading.Condition(), threading.Event()
        self._stream: ExposureStream | None = None
        self._failed: BaseException | None = None
        self._arrived: list[tuple[float, int]] = []
        self._began = time.monotonic()
        self.frames = 0
        self.error: list[Array] = []
        """E of each part."""

    def run(self) -> None:
        """Solve and check all parts; an error ends the play."""
        ready = threading.Thread(target=self._prepare_check, daemon=True)
        ready.start()
        try:
            target, parts = reproduce_stream(
                self._pressure, self._transducers, self._settings, progress=self._check_end
            )
            self.frames = target.frames
            checked = self._checked(parts, ready)
            if self._path is None:
                deque(checked, maxlen=0)
            else:
                save_solutions(checked, self._path, frames=target.frames, target=target)
        except BaseException as wrong:  # noqa: BLE001
            with self._news:
                self._failed = wrong
                if self._stream is not None:
                    self._stream.fail(wrong)
                self._news.notify_all()

    def _prepare_check(self) -> None:
        """Make what every check of this array needs, while the first part is solved."""
        array = self._device.array
        silent = Drive(phase=np.zeros((1, array.count)), level=np.zeros(1), rate=1.0, array=array)
        measure_exposure(silent, array, self._choices.profile, room=self._choices.room)

    def _check_end(self, _: int, __: int) -> None:
        if self._ends.is_set():
            raise StoppedError("solver: expected the play to go on, it ended")

    def _checked(self, parts: Iterable[Solution], ready: threading.Thread) -> Iterator[Solution]:
        done = 0
        for part in parts:
            ready.join()
            if self._stream is None:
                how = {"frames": self.frames, "repeats": self._repeats}
                self._stream = ExposureStream(part.drive, self._device, self._choices, **how)
            else:
                self._stream.add(part.drive)
            done += part.drive.frames
            self.error.append(part.error)
            with self._news:
                self._arrived.append((time.monotonic(), done))
                self._news.notify_all()
            self._check_end(0, 0)
            yield part

    def in_time(self, report: Callable[[str], object]) -> ExposureClearance:
        """Wait until the play can begin without a gap, and return its clearance; report if this takes long."""
        said = False
        with self._news:
            while True:
                self._news.wait_for(lambda: self._failed is not None or self._arrived)
                if self._failed is not None:
                    raise self._failed
                lacks, speed = self._lacks()
                if self._stream is not None and lacks <= 0:
                    return self._stream.clearance()
                if speed < 1 and not said:
                    said = True
                    report(
                        f"this computer solves {speed:.2g} s of touch in a second: the first sound comes in about "
                        f"{max(lacks, 0.1):.1g} s, so that there is no gap"
                    )
                seen = len(self._arrived)
                self._news.wait_for(lambda seen=seen: self._failed is not None or len(self._arrived) > seen)

    def _lacks(self) -> tuple[float, float]:
        """Time in s by which a play that begins now would be too early, and touch in s that is solved in a second."""
        rate, (now, done) = self._settings.target.rate, self._arrived[-1]
        rest = self.frames - done
        if not self._device.gated or rest <= 0:
            # Simulated sound can wait.
            return 0.0, np.inf
        times, counts = np.array([(self._began, 0), *self._arrived]).T
        # The first part includes the preparation, which makes its speed a lower bound.
        first = 1 if len(times) > 2 else 0
        pace = max((now - times[first]) / (done - counts[first]), (now - times[-2]) / (done - counts[-2]))
        part = min(rest, frames_per_part(self._settings.solver.solver()))
        lead = done / rate - RESERVE
        lacks = max(SLOWER * pace * part - lead, SLOWER * pace * rest - (self.frames - part) / rate + RESERVE)
        return float(lacks), float(1 / (pace * rate)) if first else np.inf

    def finish(self) -> ExposureClearance:
        """Wait until all is solved and written, and return the clearance of all frames; raises the solver's error."""
        self.join()
        if self._failed is not None or self._stream is None:
            raise self._failed or InputError("play while solving: expected frames to play, got none")
        return self._stream.clearance()

    def end(self) -> None:
        """End the solver at its next block; a drive file that is not complete is not kept."""
        self._ends.set()
        self.join()


def can_solve_ahead(device: ArrayDevice, settings: Settings, choices: ExposureChoices) -> bool:
    """False if the whole drive is needed before its first sound.

    So it is for a level at the ears, for attenuation, and for an array that does not stream or has other phase steps
    than AUTD3 units.
    """
    alike = device.streams and device.steps_a_turn == PHASE_STEPS
    return alike and settings.target.ears is None and not choices.attenuate


@contextmanager
def solved_ahead(
    pressure: PressureFrames,
    transducers: TransducerArray,
    device: ArrayDevice,
    settings: Settings,
    choices: ExposureChoices,
    *,
    repeats: int = 1,
    path: str | Path | None = None,
) -> Generator[SolvedAhead]:
    """Inside, a thread solves a pressure for the transducers of a device that plays streams, as `reproduce_stream`.

    Parameters
    ----------
    pressure : PressureFrames
        With its lead, see `add_lead`.
    transducers : TransducerArray
        Those of the device, or as they were measured.
    choices, repeats
        As in `ExposureStream`.
    path : str or Path, optional
        Drive to write, complete or not at all.

    Raises
    ------
    InputError
        If the whole drive is needed first, see `can_solve_ahead`.
    """
    if not can_solve_ahead(device, settings, choices):
        raise InputError(
            "play while solving: expected AUTD3 units, no level at the ears and no attenuation, got some of these; "
            "solve first"
        )
    with one_blas_thread():
        solver = SolvedAhead(
            pressure,
            transducers,
            device,
            settings,
            choices,
            repeats=repeats,
            path=None if path is None else Path(path),
        )
        solver.start()
        try:
            yield solver
        finally:
            solver.end()
