"""Whether anybody is still working: a cluster whose workers are gone says nothing by itself."""

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from midair.errors import ClusterError

if TYPE_CHECKING:
    from distributed import Client


class WorkersWatch:
    """The latest sign of life of any worker, as their scheduler hears it.

    Workers tell their scheduler that they live, solving or not, every half second or few seconds. What counts is
    that the latest sign changes, on this process's own clock: a computer that slept, or whose clock is wrong, is not
    taken for dead. Workers that stopped, scheduler that stopped, nobody left: no change in each case.

    Parameters
    ----------
    client : Client
        Connected.
    patience : float
        How long without a sign is the end, in s.
    """

    def __init__(self, client: "Client", *, patience: float = 20.0) -> None:
        self._client = client
        self._patience = patience
        self._latest: object = None
        self._since = time.monotonic()
        self._threads, self._asked = 0, -np.inf

    def heard(self) -> None:
        """A worker answered."""
        self._since = time.monotonic()

    def threads(self) -> int:
        """Of all workers together; asked again after two seconds, since workers come and go."""
        if time.monotonic() - self._asked > 2:
            said, self._asked = self._identity(), time.monotonic()
            if said is not None:
                self._threads = sum(worker["nthreads"] for worker in said["workers"].values())
        return self._threads

    def look(self) -> None:
        """Ask the scheduler.

        Raises
        ------
        ClusterError
            If there was no sign for too long.
        """
        latest = self._ask()
        if latest is not None and latest != self._latest:
            self._latest = latest
            self.heard()
        elif time.monotonic() - self._since > self._patience:
            raise ClusterError(
                f"sweep: expected workers at their work, got no sign of life from any for {self._patience:.0f} s; what "
                "was found so far is stored; start workers (dask worker), and the same command goes on"
            )

    def _ask(self) -> float | None:
        """When the scheduler last heard of any worker, on its clock; None if it does not say or has none."""
        said = self._identity()
        return None if said is None else max((one["last_seen"] for one in said["workers"].values()), default=None)

    def _identity(self) -> Any:
        """What the scheduler says of itself and its workers; None if it does not."""

        async def identity() -> Any:
            return await self._client.scheduler.identity()  # pyright: ignore[reportOptionalMemberAccess]

        try:
            return self._client.sync(identity, callback_timeout=5)
        except (OSError, TimeoutError, AttributeError):  # the scheduler is gone, or hangs
            return None
