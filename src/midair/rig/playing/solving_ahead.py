"""Solve a pressure in a thread while an array plays it: every part is checked ahead of its sound."""

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event, Thread
from typing import Self

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
from midair.rig.playing.play_settings import PlaySettings
from midair.settings import MODES, Settings
from midair.solvers import Glide, frames_per_part, one_blas_thread

RESERVE = 0.3
"""Time by which frames are ready before they sound, in s: the units need a tenth, the computer is not always free."""
SLOWER = 1.2
"""Factor by which the rest may take longer than measured."""


def prepare_check(array: TransducerArray, limits: ExposureChoices, rate: float) -> Future[None]:
    """Compute in a thread what exposure checks of an array need, at a rate in Hz, for a loud frame after silence."""
    done = Future[None]()

    def prepare() -> None:
        try:
            loud = Drive(phase=np.zeros((1, array.count)), level=np.ones(1), rate=rate, array=array)
            measure_exposure(loud, array, limits.profile, room=limits.room)
            done.set_result(None)
        except BaseException as wrong:  # noqa: BLE001  # raised where the result is needed
            done.set_exception(wrong)

    # A program that ends does not wait for it.
    Thread(target=prepare, name="midair check", daemon=True).start()
    return done


class SolvedAhead:
    """Inside, a thread solves a pressure, as `reproduce_stream`, and checks each part for a device.

    `transducers` are those of the device, or as they were measured; `path` is a drive to write, complete or not at all;
    `ready` is the result of `prepare_check`, if it was called earlier.
    Raises InputError if the whole drive is needed before its first sound: for a level at the ears, for attenuation, to
    follow a palm, and for an array that does not stream or has other phase steps than AUTD3 units.
    """

    def __init__(
        self,
        pressure: PressureFrames,
        transducers: TransducerArray,
        device: ArrayDevice,
        settings: Settings,
        playing: PlaySettings,
        path: str | Path | None,
        ready: Future[None] | None = None,
    ) -> None:
        alike = device.streams and device.steps_a_turn == PHASE_STEPS
        if not alike or settings.target.ears is not None or playing.exposure.attenuate or playing.follow is not None:
            raise InputError(
                "play while solving: expected AUTD3 units, no --ears, --mode quiet, --attenuate or --follow, got one "
                "of these; use midair solve, and play the drive"
            )
        self._pressure, self._transducers, self._device, self._path = pressure, transducers, device, path
        self._settings, self._playing, self._frames, self.rate = settings, playing, 0, settings.target.rate
        self._ready = ready
        self._news, self._ends, self._open = SimpleQueue[None](), Event(), ExitStack()
        self._stream: ExposureStream | None = None
        # A person answers for what was measured: with an override all of it, before the first sound.
        self._whole = playing.exposure.override is not None
        self._arrived = [(time.monotonic(), 0)]
        self.error: list[Array] = []
        """E of each part."""

    def __enter__(self) -> Self:
        # One limit around all threads: each of them would restore another one.
        self._open.enter_context(one_blas_thread())
        pool = self._open.enter_context(ThreadPoolExecutor(1))
        ready = self._ready or prepare_check(self._device.array, self._playing.exposure, self.rate)
        self._open.callback(wait, [ready])
        self._solved = pool.submit(self._solve, ready)
        self._solved.add_done_callback(lambda _: self._news.put(None))
        return self

    def __exit__(self, *_: object) -> None:
        """End the solver at its next block."""
        self._ends.set()
        self._open.close()

    def _solve(self, ready: Future[None]) -> None:
        try:
            order = (self._pressure, self._transducers, self._settings)
            target, parts = reproduce_stream(*order, progress=self._check_end)
            self._frames, checked = target.frames, self._checked(parts, ready)
            if self._path is None:
                deque(checked, maxlen=0)
            else:
                save_solutions(checked, self._path, frames=target.frames, target=target)
        except BaseException as wrong:
            if self._stream is not None:
                self._stream.fail(wrong)
            raise

    def _check_end(self, *_: int) -> None:
        if self._ends.is_set():
            raise StoppedError("solver: expected the play to go on, it ended")

    def _checked(self, parts: Iterable[Solution], ready: Future[None]) -> Iterator[Solution]:
        for part in parts:
            ready.result()
            if self._stream is None:
                how = {"frames": self._frames, "repeats": self._playing.repeats}
                self._stream = ExposureStream(part.drive, self._device, self._playing.exposure, **how)
            else:
                self._stream.add(part.drive)
            self.error.append(part.error)
            self._arrived.append((time.monotonic(), self._stream.phase.there))
            self._news.put(None)
            self._check_end()
            yield part

    def first_part(self) -> ExposureClearance:
        """Wait until the first part is checked, with an override all parts, and return the clearance.

        Raises the solver's error.
        """
        while (self._whole or len(self._arrived) == 1) and not self._solved.done():
            self._news.get()
        return self.finish() if self._stream is None or self._whole else self._stream.clearance()

    def in_time(self, report: Callable[[str], object], check: Callable[[], object] = bool) -> ExposureClearance:
        """Wait until the play can begin without a gap, and return its clearance; report if this takes long.

        `check`, called ten times a second, may raise an error that ends the wait.
        """
        lacks = 1.0
        while lacks > 0:
            # Until a part came, the solver ended, or enough time has passed.
            with suppress(Empty):
                self._news.get(timeout=min(lacks, 0.1))
            check()
            if self._solved.done():
                break
            if self._whole or len(self._arrived) == 1:
                continue
            lacks, speed = self._lacks()
            if lacks > 0 and speed < 1:
                wait = f"the first sound comes in about {max(lacks, 1):.0f} s, so that there is no gap"
                wait += "; mode quick begins sooner" if self.rate > MODES["quick"]().target.rate else ""
                report(f"this computer solves {speed:.2g} s of touch in a second: {wait}")
                report = bool  # once
        return self.finish() if self._stream is None or self._solved.done() else self._stream.clearance()

    def _lacks(self) -> tuple[float, float]:
        """Time in s by which a play that begins now would be too early, and touch in s that is solved in a second."""
        rate, (times, counts) = self._settings.target.rate, np.array(self._arrived).T
        # Simulated sound can wait.
        if not self._device.gated or counts[-1] >= self._frames:
            return 0.0, np.inf
        solver = self._settings.solver.solver()
        size, jobs = frames_per_part(solver), solver.jobs if isinstance(solver, Glide) else 1
        begins = np.arange(counts[-1], self._frames, size)
        # The last part is shorter: one thread solves a block of it, at a fraction of the speed.
        work = np.cumsum(np.minimum(size, jobs * (self._frames - begins)))
        # The first part includes the preparation, which makes its speed a lower bound.
        first, passed = 1 if len(times) > 2 else 0, time.monotonic() - times[-1]
        paces = [(times[-1] - times[each]) / (counts[-1] - counts[each]) for each in (first, -2)]
        pace = max(*paces, passed / work[0])
        late = (SLOWER * pace * work - begins / rate).max()
        return float(late + RESERVE - passed), float(1 / (pace * rate)) if first else np.inf

    def finish(self) -> ExposureClearance:
        """Wait until all is solved and written, and return the clearance of all frames; raises the solver's error."""
        self._solved.result()
        if self._stream is None:
            raise InputError("play while solving: expected frames to play, got none")
        return self._stream.clearance()
