"""A job queue with one worker process: progress, remaining time and cancellation at any moment."""

import contextlib
import itertools
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Literal

from midair.errors import MidairError

JobState = Literal["waits", "runs", "done", "failed", "cancelled"]

Progressed = Callable[[str, int, int], None]
"""Called with the name of the current stage, the steps done, and the number of steps."""

Work = Callable[[Any, Progressed], Any]
"""A module-level function that takes the input of a job and a `Progressed` callback, and returns the result."""


@dataclass(slots=True, kw_only=True)
class StudioJob:
    """State of one job."""

    number: int
    """Counts from 1."""
    title: str
    """Description that the page shows."""
    room: str
    """Name of the panel that added the job."""
    state: JobState = "waits"
    stage: str = ""
    done: int = 0
    total: int = 0
    error: str = ""
    """Message, if it failed."""
    result: Any = None
    began: float = 0.0
    stage_began: float = 0.0
    ended: Callable[["StudioJob"], None] = field(default=lambda _: None, repr=False)

    def as_dict(self, now: float) -> dict[str, Any]:
        """Return the state for the page, with rate (steps/s) and remaining time in s once they are known."""
        spent = now - self.stage_began
        rate = self.done / spent if self.state == "runs" and self.done and spent > 0.2 else 0.0
        left = (self.total - self.done) / rate if rate else None
        return {
            "number": self.number,
            "title": self.title,
            "room": self.room,
            "state": self.state,
            "stage": self.stage,
            "done": self.done,
            "total": self.total,
            "error": self.error,
            "rate": round(rate, 1),
            "left_s": None if left is None else round(left, 1),
        }


class Jobs:
    """A queue of jobs for one worker process, which starts on demand and restarts if it dies.

    `changed` is called from a thread of the queue whenever a job changes; `warm` runs first in the worker process.
    """

    def __init__(
        self, changed: Callable[[StudioJob], None], *, name: str = "work", warm: Callable[[], None] | None = None
    ) -> None:
        self._changed, self._name, self._warm = changed, name, warm
        self._lock = threading.RLock()
        self._numbers = itertools.count(1)
        self._waiting: list[tuple[StudioJob, Work, Any]] = []
        self._running: StudioJob | None = None
        self._process: Any = None
        self._pipe: Connection | None = None
        self._closed = False

    def start(self) -> None:
        """Start the worker process before the first job."""
        with self._lock:
            self._ready()

    def add(
        self,
        title: str,
        work: Work,
        order: Any,
        *,
        room: str = "",
        ended: Callable[[StudioJob], None] = lambda _: None,
        first: bool = False,
    ) -> StudioJob:
        """Add a job at the end of the queue, or before the waiting ones if `first`."""
        with self._lock:
            job = StudioJob(number=next(self._numbers), title=title, room=room, ended=ended)
            self._waiting.insert(0 if first else len(self._waiting), (job, work, order))
            self._next()
        self._changed(job)
        return job

    def unfinished(self) -> list[StudioJob]:
        """Return the running job, then the waiting ones."""
        with self._lock:
            return [*([self._running] if self._running is not None else []), *(entry[0] for entry in self._waiting)]

    def cancel(self, number: int) -> bool:
        """Cancel a waiting or running job; False if there is none with this number. No file is left half written."""
        with self._lock:
            for entry in self._waiting:
                if entry[0].number == number:
                    self._waiting.remove(entry)
                    self._end(entry[0], "cancelled")
                    return True
            if self._running is None or self._running.number != number:
                return False
            job, self._running = self._running, None
            # A solver cannot be interrupted: its process ends, and the next job gets a new one.
            self._drop()
            self._end(job, "cancelled")
            self._next()
            return True

    def close(self) -> None:
        """End the process and drop all jobs."""
        with self._lock:
            self._closed = True
            self._waiting.clear()
            self._running = None
            self._drop()

    @property
    def process(self) -> int:
        """Process ID of the worker; 0 if there is none."""
        return self._process.pid if self._process is not None else 0

    def _ready(self) -> Connection:
        if self._pipe is None or self._process is None or not self._process.is_alive():
            context = get_context("spawn")
            here, there = context.Pipe()
            self._process = context.Process(
                target=serve_jobs, args=(there, self._warm), name=f"midair {self._name}", daemon=True
            )
            self._process.start()
            there.close()
            self._pipe = here
            threading.Thread(target=self._listen, args=(here,), name=f"{self._name} results", daemon=True).start()
        return self._pipe

    def _next(self) -> None:
        """Start the next job; the lock must be held."""
        if self._running is not None or not self._waiting or self._closed:
            return
        job, work, order = self._waiting.pop(0)
        pipe = self._ready()
        job.state, job.began = "runs", time.monotonic()
        job.stage_began = job.began
        self._running = job
        pipe.send((job.number, work, order))

    def _listen(self, pipe: Connection) -> None:
        """Handle messages of the worker until it ends."""
        while True:
            try:
                number, kind, value = pipe.recv()
            except (EOFError, OSError, TypeError):
                self._lost(pipe)
                return
            with self._lock:
                job = self._running
                if job is None or job.number != number:
                    continue
                if kind == "progress":
                    stage, job.done, job.total = value
                    if stage != job.stage:
                        job.stage, job.stage_began = stage, time.monotonic()
                else:
                    self._running = None
            if kind == "progress":
                self._changed(job)
                continue
            job.result, job.error = (value, "") if kind == "done" else (None, value)
            self._end(job, "done" if kind == "done" else "failed")
            with self._lock:
                self._next()

    def _lost(self, pipe: Connection) -> None:
        """Mark the job of a dead worker as failed, and start the next job in a new process."""
        with self._lock:
            if pipe is not self._pipe or self._closed:
                return
            self._pipe, job, self._running = None, self._running, None
            if job is not None:
                job.error = "the worker process ended unexpectedly; there may be too little memory"
                self._end(job, "failed")
            self._next()

    def _end(self, job: StudioJob, state: JobState) -> None:
        job.state = state
        job.ended(job)
        self._changed(job)

    def _drop(self) -> None:
        process, pipe = self._process, self._pipe
        self._process = self._pipe = None
        if process is not None:
            process.terminate()
            process.join(2)
            if process.is_alive():
                process.kill()
                process.join(2)
        if pipe is not None:
            pipe.close()


def serve_jobs(pipe: Connection, warm: Callable[[], None] | None) -> None:
    """Main loop of the worker process: run one job after the other until the pipe is closed."""
    # Ctrl-C in the terminal reaches the studio, which then ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(AttributeError, OSError):
        os.nice(5)
    if warm is not None:
        warm()
    while True:
        try:
            number, work, order = pipe.recv()
        except (EOFError, OSError):
            return
        last = [0.0]

        def progress(stage: str, done: int, total: int, number: int = number, last: list[float] = last) -> None:
            now = time.monotonic()
            # The page shows at most ten updates per second.
            if now - last[0] > 0.1 or done >= total:
                last[0] = now
                pipe.send((number, "progress", (stage, done, total)))

        try:
            answer = (number, "done", work(order, progress))
        except MidairError as wrong:
            answer = (number, "failed", str(wrong))
        except Exception as wrong:  # noqa: BLE001  # the process goes on with the next job
            answer = (
                number,
                "failed",
                f"this is an error in midair, please report it: {type(wrong).__name__}: {wrong}",
            )
        with contextlib.suppress(BrokenPipeError, OSError):
            pipe.send(answer)
