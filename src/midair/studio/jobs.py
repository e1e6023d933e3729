"""A job queue with one worker process: progress, remaining time and cancellation at any moment."""

import asyncio
import contextlib
import itertools
import os
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any, Literal

from midair.errors import InputError
from midair.studio.worker_process import StudioPipe, WorkerProcess

JobState = Literal["waits", "runs", "done", "failed", "cancelled"]

Progressed = Callable[[str, int, int], None]
"""Called with the name of the current stage, the steps done, and the number of steps."""

LONG, NEVER = 1.0, 86400.0
"""Seconds after which a page shows a job that it waits for, and one that fills a picture."""

_NUMBERS = itertools.count(1)

Work = Callable[[Any, Progressed], Any]
"""A module-level function that takes the input of a job and a `Progressed` callback, and returns the result."""


@dataclass(slots=True, kw_only=True)
class StudioJob:
    """State of one job."""

    number: int
    """Unique among all queues."""
    title: str
    """Description that the page shows."""
    room: str
    """Name of the panel that added the job."""
    quiet: bool = False
    """True if pages do not show it."""
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
        names = ("number", "title", "room", "state", "stage", "done", "total", "error")
        shown = {name: getattr(self, name) for name in names}
        return {**shown, "rate": round(rate, 1), "left_s": None if left is None else round(left, 1)}


class Jobs:
    """A queue of jobs for one worker process, which starts on demand and restarts if it dies.

    `changed` is called from a thread of the queue whenever a job changes; `warm` runs first in the worker process.
    """

    def __init__(
        self,
        changed: Callable[[StudioJob], None] = lambda _: None,
        *,
        name: str = "work",
        warm: Callable[[], None] | None = None,
    ) -> None:
        self._changed, self._warm = changed, warm
        self._lock = threading.RLock()
        self._waiting: list[tuple[StudioJob, Work, Any]] = []
        self._running: StudioJob | None = None
        gone = "the worker process ended unexpectedly: a file may be damaged, or memory may be short"
        self._worker = WorkerProcess(serve_jobs, self._on_event, name=name, absent=gone, gone=gone)
        self._closed = False

    def start(self) -> None:
        """Start the worker process before the first job."""
        with self._lock:
            if not self._worker.process:
                self._worker.start(self._warm)

    def add(
        self,
        title: str,
        work: Work,
        order: Any,
        *,
        room: str = "",
        ended: Callable[[StudioJob], None] = lambda _: None,
        first: bool = False,
        quiet: bool = False,
    ) -> StudioJob:
        """Add a job at the end of the queue, or before the waiting ones if `first`."""
        with self._lock:
            job = StudioJob(number=next(_NUMBERS), title=title, room=room, ended=ended, quiet=quiet)
            self._waiting.insert(0 if first else len(self._waiting), (job, work, order))
            self._next()
        self._tell(job)
        return job

    async def result(self, title: str, work: Work, order: Any, *, after: float = LONG) -> Any:
        """Add a job before the waiting ones, shown `after` s, and return its result; InputError if it fails."""
        done = Future[StudioJob]()
        done.set_running_or_notify_cancel()
        job = self.add(title, work, order, ended=done.set_result, first=True, quiet=True)
        shown = asyncio.get_running_loop().call_later(after, self._show, job)
        try:
            await asyncio.wrap_future(done)
        finally:
            shown.cancel()
        if job.state != "done":
            raise InputError(job.error or f"{title}: {job.state}")
        return job.result

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
            self._worker.close()
            self._end(job, "cancelled")
            self._next()
            return True

    def close(self) -> None:
        """End the process and drop all jobs."""
        with self._lock:
            self._closed = True
            self._waiting.clear()
            self._running = None
            self._worker.close()

    @property
    def process(self) -> int:
        """Process ID of the worker; 0 if there is none."""
        return self._worker.process

    def _next(self) -> None:
        """Start the next job; the lock must be held."""
        if self._running is not None or not self._waiting or self._closed:
            return
        job, work, order = self._waiting.pop(0)
        self.start()
        job.state, job.began = "runs", time.monotonic()
        job.stage_began = job.began
        self._running = job
        answer = self._worker.request("work", number=job.number, work=work, order=order)
        answer.add_done_callback(lambda answer: self._done(job, answer))

    def _on_event(self, said: dict[str, Any]) -> None:
        with self._lock:
            job = self._running
            if said["kind"] != "progress" or job is None or job.number != said["number"]:
                return
            job.done, job.total = said["done"], said["total"]
            if said["stage"] != job.stage:
                job.stage, job.stage_began = said["stage"], time.monotonic()
        self._tell(job)

    def _done(self, job: StudioJob, answer: Future[Any]) -> None:
        """End a job with the answer of the worker, or because the worker has died, and start the next one."""
        with self._lock:
            if job is not self._running:
                return
            self._running = None
        wrong = answer.exception()
        job.result, job.error = (answer.result(), "") if wrong is None else (None, str(wrong))
        self._end(job, "done" if wrong is None else "failed")
        with self._lock:
            self._next()

    def _end(self, job: StudioJob, state: JobState) -> None:
        job.state = state
        job.ended(job)
        self._tell(job)

    def _show(self, job: StudioJob) -> None:
        job.quiet = False
        self._tell(job)

    def _tell(self, job: StudioJob) -> None:
        if not job.quiet:
            self._changed(job)


def serve_jobs(pipe: StudioPipe, warm: Callable[[], None] | None) -> None:
    """Main loop of the worker process: run one job after the other until the studio ends."""
    with contextlib.suppress(AttributeError, OSError):
        os.nice(5)
    if warm is not None:
        warm()

    def run(order: dict[str, Any]) -> Any:
        last = 0.0

        def progress(stage: str, done: int, total: int) -> None:
            nonlocal last
            now = time.monotonic()
            # The page shows at most ten updates per second.
            if now - last > 0.1 or done >= total:
                last = now
                if not pipe.send("progress", number=order["number"], stage=stage, done=done, total=total):
                    sys.exit()

        return order["work"](order["order"], progress)

    pipe.serve(run)
