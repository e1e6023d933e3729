"""Detect a cluster without live workers, which Dask does not report."""

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import ClusterError

if TYPE_CHECKING:
    from distributed import Client


class WorkerMonitor:
    """Monitor of the workers' heartbeats through their scheduler.

    Workers send heartbeats to their scheduler every half second or few seconds, also while they solve. The monitor only
    checks that the latest heartbeat changes within `patience` seconds of this process's own clock, so that a suspended
    computer or a wrong clock does not count as a failure.
    """

    def __init__(self, client: "Client", *, patience: float = 20.0) -> None:
        self._client = client
        self._patience = patience
        self._latest: object = None
        self._since = time.monotonic()
        self._threads, self._asked = 0, -np.inf

    def reset(self) -> None:
        """Restart the time limit after a response of a worker."""
        self._since = time.monotonic()

    def threads(self) -> int:
        """Number of threads of all workers, updated every two seconds because workers come and go."""
        if time.monotonic() - self._asked > 2:
            identity, self._asked = self._identity(), time.monotonic()
            if identity is not None:
                self._threads = sum(worker["nthreads"] for worker in identity["workers"].values())
        return self._threads

    def look(self) -> None:
        """Query the scheduler; raise a ClusterError if there was no heartbeat for too long."""
        latest = self._ask()
        if latest is not None and latest != self._latest:
            self._latest = latest
            self.reset()
        elif time.monotonic() - self._since > self._patience:
            raise ClusterError(
                f"sweep: expected running workers, got no heartbeat for {self._patience:.0f} s; all results so far "
                "are stored; start workers (dask worker) and repeat the command to continue"
            )

    def _ask(self) -> float | None:
        """Time of the latest heartbeat on the scheduler's clock; None without an answer or workers."""
        found = self._identity()
        return None if found is None else max((one["last_seen"] for one in found["workers"].values()), default=None)

    def _identity(self) -> Any:
        """Identity of the scheduler and its workers; None without an answer."""

        async def identity() -> Any:
            return await self._client.scheduler.identity()  # pyright: ignore[reportOptionalMemberAccess]

        try:
            return self._client.sync(identity, callback_timeout=5)
        except (OSError, TimeoutError, AttributeError):  # the scheduler is gone, or hangs
            return None
