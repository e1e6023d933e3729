"""Solve a pressure in a thread while an array plays it: every part is checked ahead of its sound."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Self

import numpy as np

from midair.array_types import Array
from midair.devices import PHASE_STEPS, ArrayDevice, ExposureClearance, ExposureStream, measure_exposure
from midair.errors import InputError, StoppedError
from midair.files import save_solutions
from midair.model import Drive, PressureFrames, Solution, TransducerArray
from midair.pipeline import reproduce_stream
from midair.rig.playing.play_settings import PlaySettings
from midair.settings import Settings
from midair.solvers import frames_per_part, one_blas_thread

RESERVE = 0.3
"""Time by which frames are ready before they sound, in s: the units need a tenth, the computer is not always free."""
SLOWER = 1.2
"""Factor by which the rest may take longer than measured."""


class SolvedAhead:
    """Inside, a thread solves a pressure, as `reproduce_stream`, and checks each part for a device.

    `transducers` are those of the device, or as they were measured; `path` is a drive to write, complete or not at all.
    Raises InputError if the whole drive is needed before its first sound: for a level at the ears, for attenuation, and
    for an array that does not stream or has other phase steps than AUTD3 units.
    """

    def __init__(
        self,
        pressure: PressureFrames,
        transducers: TransducerArray,
        device: ArrayDevice,
        settings: Settings,
        playing: PlaySettings,
        path: str | Path | None,
    ) -> None:
        alike = device.streams and device.steps_a_turn == PHASE_STEPS
        if not alike or settings.target.ears is not None or playing.exposure.attenuate or playing.follow is not None:
            raise InputError(
                "play while solving: expected AUTD3 units, no --ears, --mode quiet, --attenuate or --follow, got one "
                "of these; use midair solve, and play the drive"
            )
        self._pressure, self._transducers, self._device, self._path = pressure, transducers, device, path
        self._settings, self._playing = settings, playing
        self._news, self._ends, self._blas = threading.Condition(), threading.Event(), one_blas_thread()
        self._stream: ExposureStream | None = None
        self._failed: BaseException | None = None
        self._arrived: list[tuple[float, int]] = []
        self._began, self._frames, self._new = time.monotonic(), 0, False
        self.error: list[Array] = []
        """E of each part."""
        self._solver = threading.Thread(target=self._solve, name="midair solver", daemon=True)

    def __enter__(self) -> Self:
        # One limit around all threads: each of them would restore another one.
        self._blas.__enter__()
        self._solver.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End the solver at its next block."""
        self._ends.set()
        self._solver.join()
        self._blas.__exit__(None, None, None)

    def _solve(self) -> None:
        ready = threading.Thread(target=self._prepare_check, daemon=True)
        ready.start()
        try:
            target, parts = reproduce_stream(
                self._pressure, self._transducers, self._settings, progress=self._check_end
            )
            self._frames, checked = target.frames, self._checked(parts, ready)
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
        """Compute what every check of this array needs, while the first part is solved."""
        array, choices = self._device.array, self._playing.exposure
        silent = Drive(phase=np.zeros((1, array.count)), level=np.zeros(1), rate=1.0, array=array)
        measure_exposure(silent, array, choices.profile, room=choices.room)

    def _check_end(self, _: int, __: int) -> None:
        if self._ends.is_set():
            raise StoppedError("solver: expected the play to go on, it ended")

    def _checked(self, parts: Iterable[Solution], ready: threading.Thread) -> Iterator[Solution]:
        done = 0
        for part in parts:
            ready.join()
            if self._stream is None:
                how = {"frames": self._frames, "repeats": self._playing.repeats}
                self._stream = ExposureStream(part.drive, self._device, self._playing.exposure, **how)
            else:
                self._stream.add(part.drive)
            done += part.drive.frames
            self.error.append(part.error)
            with self._news:
                self._arrived.append((time.monotonic(), done))
                self._new = True
                self._news.notify_all()
            self._check_end(0, 0)
            yield part

    def in_time(self, report: Callable[[str], object]) -> ExposureClearance:
        """Wait until the play can begin without a gap, and return its clearance; report if this takes long."""
        said = False
        with self._news:
            while True:
                self._news.wait_for(lambda: self._failed is not None or self._new)
                self._new = False
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

    def _lacks(self) -> tuple[float, float]:
        """Time in s by which a play that begins now would be too early, and touch in s that is solved in a second."""
        rate, (now, done) = self._settings.target.rate, self._arrived[-1]
        rest = self._frames - done
        # Simulated sound can wait.
        if not self._device.gated or rest <= 0:
            return 0.0, np.inf
        times, counts = np.array([(self._began, 0), *self._arrived]).T
        # The first part includes the preparation, which makes its speed a lower bound.
        first = 1 if len(times) > 2 else 0
        pace = max((now - times[first]) / (done - counts[first]), (now - times[-2]) / (done - counts[-2]))
        part = min(rest, frames_per_part(self._settings.solver.solver()))
        next_late = SLOWER * pace * part - done / rate
        last_late = SLOWER * pace * rest - (self._frames - part) / rate
        return float(max(next_late, last_late) + RESERVE), float(1 / (pace * rate)) if first else np.inf

    def finish(self) -> ExposureClearance:
        """Wait until all is solved and written, and return the clearance of all frames; raises the solver's error."""
        self._solver.join()
        if self._failed is not None or self._stream is None:
            raise self._failed or InputError("play while solving: expected frames to play, got none")
        return self._stream.clearance()
