"""Play a recording while it is solved: a thread solves, checks and writes its parts ahead of the sound."""

import os
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

from midair.devices import ArrayDevice, ExposureChoices, ExposureStream
from midair.errors import StoppedError
from midair.files import save_solutions
from midair.model import PressureFrames, Progress, Solution, TransducerArray
from midair.pipeline import reproduce_stream
from midair.settings import Settings


@contextmanager
def solving(
    pressure: PressureFrames,
    transducers: TransducerArray,
    settings: Settings,
    device: ArrayDevice,
    exposure: ExposureChoices,
    *,
    repeats: int = 1,
    keep: Path | None = None,
    progress: Progress | None = None,
) -> Generator[ExposureStream]:
    """While inside, solve a pressure with its lead for an array that plays the stream; leaving stops the solver.

    Parameters
    ----------
    transducers : TransducerArray
        Transducers that the solver assumes.
    device : ArrayDevice
        The array that will play the stream; it need not be open.
    exposure, repeats
        As in `check_exposure`.
    keep : Path, optional
        File for the drive, bit-identical to that of `midair solve`; it appears once all parts are solved.
    progress : callable, optional
        Called with (frames solved, total frames).
    """
    left = threading.Event()
    settings = settings if settings.solver.jobs else settings.but(jobs=os.cpu_count() or 1)

    def report(done: int, total: int) -> None:
        if left.is_set():
            raise StoppedError("solve: stopped with the playback")
        if progress is not None:
            progress(done, total)

    target, parts = reproduce_stream(pressure, transducers, settings, progress=report)
    stream = ExposureStream(device, exposure, frames=target.frames, repeats=repeats)

    def checked() -> Iterator[Solution]:
        began = time.monotonic()
        for part in parts:
            stream.add(part.drive, took=time.monotonic() - began)
            yield part
            began = time.monotonic()

    def save() -> None:
        save_solutions(checked(), keep or "", frames=target.frames, target=target)

    def drain() -> None:
        for _ in checked():
            pass

    thread = threading.Thread(target=_ended, args=(stream, drain if keep is None else save), name="midair solve")
    thread.start()
    try:
        stream.prepare()
        yield stream
        if keep is not None:
            # Played to the end, but the file may not have its name yet.
            thread.join()
            stream.check()
    finally:
        left.set()
        thread.join()
        stream.end(StoppedError("solve: stopped with the playback"))


def _ended(stream: ExposureStream, work: Callable[[], None]) -> None:
    try:
        work()
    except BaseException as wrong:  # noqa: BLE001, the reader of the stream raises it
        stream.end(wrong)
    else:
        stream.end()
