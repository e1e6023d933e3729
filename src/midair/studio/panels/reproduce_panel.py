"""Panel Reproduce: the takes, the settings of their drives, and the jobs that solve them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import Field

from midair.errors import InputError
from midair.studio.jobs import StudioJob
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.studio_state import Arguments, Page
from midair.studio.take_data import describe_settings, facts, made_with
from midair.studio.work import SolveForm, SolveRequest, make_sample, report_loop, settings_of, solve_take, stamp_of


class TakeNamed(Arguments):
    """Name of a take."""

    take: str = Field(max_length=1000)


class JobNumber(Arguments):
    """Number of a job."""

    number: int


class ReproducePanel(Panel):
    """Takes and drives."""

    name, title, script = "reproduce", "Reproduce", WEB / "room-reproduce.js"

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self._jobs, self._reading, self._sampled = context.jobs, context.reading, False
        store = context.store
        store.offer("reproduce", "open", self.open, TakeNamed, watchers=True)
        store.offer("reproduce", "solve", self.solve, SolveForm)
        store.offer("reproduce", "code", self.code, SolveForm, watchers=True)
        store.offer("compare", "report", self.report, SolveForm)
        store.offer("jobs", "cancel", self.cancel, JobNumber)
        context.show_takes()

    def start(self) -> None:
        """Make the samples; the first one is shown and solved while the others are computed."""
        for thing in ("towel", "brush", "sponge"):
            order = (str(self._takes.samples), thing)
            self._reading.add(f"sample {thing}", make_sample, order, ended=lambda _: self._context.later(self._made))

    async def open(self, _: Page, order: TakeNamed) -> Any:
        """Return the facts of a take."""
        if self._takes.is_pending(order.take):
            return {"stamp": "first", **self._context.first.facts}
        data = self._takes.data(order.take)
        found = await self._reading.result(f"reading {order.take}", facts, data)
        return {"stamp": data.stamp, "part": data.drive == self._takes.preview_path(order.take), **found}

    def code(self, _: Page, order: SolveForm) -> dict[str, Any]:
        """Return the settings of a form as commands and Python."""
        return describe_settings(settings_of(self._request(order)))

    async def solve(self, _: Page, order: SolveForm) -> dict[str, Any]:
        """Add the solving of a take to the queue, the visible second first.

        If a drive or a re-recording exists, the answer is a question instead; `replaces` with its stamp is the consent.
        """
        request = self._request(order)
        new = describe_settings(settings_of(request))["line"]  # raises now rather than in the job
        there = [path for path in (request.drive, *(path for path, _ in request.outdated)) if stamp_of(path)]
        stamp = "-".join(map(stamp_of, there))
        if there and order.replaces != stamp:
            title = f"reading {order.take}"
            made = await self._reading.result(title, made_with, request.drive) if request.replaces else ""
            return {"asks": {"files": [Path(path).name for path in there], "made": made, "new": new, "replaces": stamp}}
        return {"job": self._solve(order, request).number}

    def _request(self, order: SolveForm) -> SolveRequest:
        drive, again = (self._takes.beside(order.take, ending) for ending in (".drive.h5", ".rerecorded.h5"))
        made = order.request(self._takes.path(order.take), self._context.air.stated)
        return replace(made, drive=str(drive), replaces=stamp_of(drive), outdated=((str(again), stamp_of(again)),))

    def _solve(self, order: SolveForm, whole: SolveRequest) -> StudioJob:
        title, sight = f"solve {order.take}", f"solve the visible second of {order.take}"
        for job in self._jobs.unfinished():
            if job.title in (title, sight):
                self._jobs.cancel(job.number)
        Path(self._takes.preview_path(order.take)).unlink(missing_ok=True)
        if order.visible_s is not None:
            part = self._takes.preview_path(order.take)
            first = replace(whole, drive=part, start=order.visible_s, duration=1.0, replaces="", outdated=())
            self._jobs.add(sight, solve_take, first, room="reproduce", ended=self._ended(order.take, title))
        return self._jobs.add(title, solve_take, whole, room="reproduce", ended=self._ended(order.take, title))

    def _made(self) -> None:
        """Show a new sample, and solve the first one, so that there is something to show and play at once."""
        self._context.show_takes()
        rows = [row for row in self._takes.rows() if row["sample"] and not self._takes.is_pending(row["name"])]
        if rows and not rows[0]["solved"] and not self._sampled:
            self._sampled = True
            sample = SolveForm(take=rows[0]["name"], mode="paper", method="live", level="auto")
            self._solve(sample, self._request(sample))

    def report(self, _: Page, order: SolveForm) -> dict[str, int]:
        """Run the whole loop on the virtual rig and write its report, as a job."""
        target = self._takes.beside(order.take, ".report.html")
        solve = order.request(self._takes.path(order.take), self._context.air.stated)
        settings_of(solve)
        title = f"report of {order.take}"
        job = self._jobs.add(title, report_loop, (solve, str(target)), room="compare", ended=self._solved)
        return {"job": job.number}

    def cancel(self, _: Page, order: JobNumber) -> bool:
        """Cancel a job."""
        if not self._jobs.cancel(order.number):
            raise InputError(f"job {order.number}: expected a waiting or running job, it has ended")
        return True

    def _ended(self, take: str, title: str) -> Any:
        def ended(job: StudioJob) -> None:
            # The visible second is shown until the whole drive exists or has failed.
            if title not in [each.title for each in self._jobs.unfinished()]:
                Path(self._takes.preview_path(take)).unlink(missing_ok=True)
            if job.title == title and job.state == "done":
                # The comparison was made with the previous drive.
                self._takes.comparison_path(take).unlink(missing_ok=True)
            self._solved(job)

        return ended

    def _solved(self, _: StudioJob) -> None:
        self._context.later(self._context.show_takes)
