"""Panel Compare: original and re-recording, their figures, and a correction that can be applied."""

from collections.abc import Callable
from typing import Any

from midair.errors import InputError
from midair.studio.jobs import Jobs, StudioJob, Work
from midair.studio.panels.reproduce_panel import TakeNamed
from midair.studio.studio_state import Page, StudioState
from midair.studio.takes_list import TakesList
from midair.studio.work import budget_of_take, compare_takes, palm_of_take


class ComparePanel:
    """Comparisons of this session; runs after each play."""

    def __init__(self, store: StudioState, takes: TakesList, jobs: Jobs, played: Any, later: Any) -> None:
        self._store, self._takes, self._jobs, self._later = store, takes, jobs, later
        self._found: dict[str, Any] = {}
        self._palms: dict[str, Any] = {}
        self._budgets: dict[str, Any] = {}
        store.offer("compare", "compare", self.compare, TakeNamed)
        store.offer("compare", "palm", self.palm, TakeNamed)
        store.offer("compare", "budget", self.budget, TakeNamed)
        played.played.append(self._played)
        store.put(comparisons={}, palms={}, budgets={})

    def compare(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Compare a take with its re-recording."""
        again = self._takes.beside(order.take, ".rerecorded.h5")
        if not again.exists():
            raise InputError(f"{order.take}: expected a take that was played and re-recorded; play it first")
        return {"job": self._start(order.take).number}

    def palm(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Simulate the pressure of a take's drive on a whole palm."""
        return self._simulate(order.take, f"palm simulation of {order.take}", palm_of_take, self._palm_ready)

    def budget(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Compute the error budget of a take's drive."""
        return self._simulate(order.take, f"error budget of {order.take}", budget_of_take, self._budget_ready)

    def _simulate(self, take: str, title: str, work: Work, ready: Callable[[str, StudioJob], None]) -> dict[str, int]:
        drive = self._takes.beside(take, ".drive.h5")
        if not drive.exists():
            raise InputError(f"{take}: expected a take that was solved; solve it first")
        order = (str(self._takes.path(take)), str(drive))
        job = self._jobs.add(title, work, order, room="compare", ended=lambda job: self._later(ready, take, job))
        return {"job": job.number}

    def _budget_ready(self, take: str, job: StudioJob) -> None:
        if job.state == "done":
            self._budgets = {**self._budgets, take: job.result}
            self._store.put(budgets=self._budgets)

    def _palm_ready(self, take: str, job: StudioJob) -> None:
        if job.state == "done":
            self._palms = {**self._palms, take: job.result}
            self._store.put(palms=self._palms)

    def _played(self, take: str) -> None:
        """Compare a take after it was played."""
        if self._takes.beside(take, ".rerecorded.h5").exists():
            self._start(take)
        self._store.put(takes=self._takes.rows())

    def _start(self, take: str) -> StudioJob:
        order = (
            str(self._takes.path(take)),
            str(self._takes.beside(take, ".rerecorded.h5")),
            str(self._takes.comparison_path(take)),
            str(self._takes.beside(take, ".drive.h5")),
        )
        return self._jobs.add(
            f"compare {take}",
            compare_takes,
            order,
            room="compare",
            ended=lambda job: self._later(self._compared, take, job),
        )

    def _compared(self, take: str, job: StudioJob) -> None:
        if job.state == "done":
            self._found = {**self._found, take: {**job.result, "kept": ""}}
            self._store.put(comparisons=self._found, takes=self._takes.rows())
