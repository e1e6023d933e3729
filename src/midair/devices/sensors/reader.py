"""A thread that reads a source continuously, so that no frames are lost during slow disk access."""

import threading
from collections import deque

from midair.devices.sensors.sources import Chunk, Source
from midair.errors import MidairError


class Reader:
    """Buffers chunks of a started source up to `limit` bytes; beyond it the newest chunks are dropped and counted.

    `pull` is called from the reader's thread only.
    """

    def __init__(self, source: Source, rate: float, *, limit: float) -> None:
        self.dropped = 0
        self._source, self._rate, self._limit = source, rate, limit
        self._waiting: deque[Chunk] = deque()
        self._held = 0
        self._failure: Exception | None = None
        self._ends = threading.Event()
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="midair source", daemon=True)
        self._thread.start()

    def take(self, wait: float) -> Chunk | None:
        """Return the oldest chunk, waiting up to `wait` seconds, or None; raises the source's error after its last
        chunk.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._failure, wait)
            if self._waiting:
                chunk = self._waiting.popleft()
                self._held -= chunk.samples.nbytes
                return chunk
            if self._failure is not None:
                raise self._failure
            return None

    def ready(self, wait: float) -> bool:
        """Wait up to `wait` seconds; True if `take` would return a chunk, or raise, at once."""
        if self._waiting:
            return True
        with self._changed:
            return bool(self._changed.wait_for(lambda: self._waiting or self._failure, wait))

    def stop(self) -> None:
        """End the thread; buffered chunks are discarded."""
        self._ends.set()
        self._thread.join(5.0)

    def _run(self) -> None:
        try:
            while not self._ends.is_set():
                # A short wait, so that `stop` is noticed even without data.
                chunk = self._source.pull(0.1)
                if chunk is not None:
                    for part in chunk.finite_parts(self._rate):
                        self._put(part)
        except MidairError as wrong:
            self._fail(wrong)
        except Exception as wrong:  # noqa: BLE001  # the next call of `take` raises it
            self._fail(wrong)

    def _put(self, chunk: Chunk) -> None:
        with self._changed:
            if self._held + chunk.samples.nbytes > self._limit:
                self.dropped += len(chunk)
                return
            self._waiting.append(chunk)
            self._held += chunk.samples.nbytes
            self._changed.notify_all()

    def _fail(self, failure: Exception) -> None:
        with self._changed:
            self._failure = failure
            self._changed.notify_all()
