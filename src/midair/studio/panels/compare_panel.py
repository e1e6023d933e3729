"""Panel Compare: original and re-recording, their figures, and a correction that can be applied."""

from typing import Any

from midair.errors import InputError
from midair.studio.importing import run_report
from midair.studio.jobs import StudioJob, Work
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.panels.reproduce_panel import TakeNamed
from midair.studio.studio_state import Page
from midair.studio.work import budget_of_take, compare_takes, palm_of_take


class ComparePanel(Panel):
    """Comparisons of this session; runs after each play."""

    name, title, script, place = "compare", "Compare", WEB / "room-compare.js", 5

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        store = context.store
        self._offer(compare=TakeNamed, report=TakeNamed, palm=TakeNamed, budget=TakeNamed)
        context.playing.played.append(self._played)
        store.put(comparisons={}, palms={}, budgets={})

    def compare(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Compare a take with its re-recording."""
        self._check_played(order.take)
        return self._compare(order.take)

    def report(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Write what Compare shows as a page, which `midair compare --report` makes."""
        self._check_played(order.take)
        names = (self._takes.beside(order.take, f".{ending}") for ending in ("rerecorded.h5", "report.html"))
        return self._add(order.take, f"report of {order.take}", run_report, (self._takes.path(order.take), *names))

    def _check_played(self, take: str) -> None:
        if not self._takes.beside(take, ".rerecorded.h5").exists():
            raise InputError(f"{take}: expected a take that was played and re-recorded; play it first")

    def palm(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Simulate the pressure of a take's drive on a whole palm."""
        return self._simulate(order.take, f"palm simulation of {order.take}", palm_of_take, "palms")

    def budget(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Compute the error budget of a take's drive."""
        return self._simulate(order.take, f"error budget of {order.take}", budget_of_take, "budgets")

    def _simulate(self, take: str, title: str, work: Work, section: str) -> dict[str, int]:
        drive = self._takes.beside(take, ".drive.h5")
        if not drive.exists():
            raise InputError(f"{take}: expected a take that was solved; solve it first")
        return self._add(take, title, work, (str(self._takes.path(take)), str(drive)), section)

    def _played(self, take: str) -> None:
        """Compare a take after it was played; a drawn pattern has no recording to compare with."""
        if not take.endswith(".toml") and self._takes.beside(take, ".rerecorded.h5").exists():
            self._compare(take)
        self._context.show_takes()

    def _compare(self, take: str) -> dict[str, int]:
        order = (
            str(self._takes.path(take)),
            str(self._takes.beside(take, ".rerecorded.h5")),
            str(self._takes.comparison_path(take)),
            str(self._takes.beside(take, ".drive.h5")),
        )
        return self._add(take, f"compare {take}", compare_takes, order, "comparisons")

    def _add(self, take: str, title: str, work: Work, order: Any, section: str = "") -> dict[str, int]:
        """Add a job whose result becomes that of the take in a section of the state, if one is named."""

        def ready(job: StudioJob) -> None:
            if job.state == "done":
                if section:
                    self._store.put(**{section: {**self._store.state[section], take: job.result}})
                self._context.show_takes()

        job = self._context.jobs.add(
            title, work, order, room="compare", ended=lambda job: self._context.later(ready, job)
        )
        return {"job": job.number}
