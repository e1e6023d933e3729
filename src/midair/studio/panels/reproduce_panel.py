"""Room Reproduce: takes, how a drive is made of one, and the job that makes it."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from midair.errors import InputError
from midair.settings import Mode
from midair.studio.job_call import result_of
from midair.studio.jobs import Jobs, Progressed, StudioJob
from midair.studio.studio_state import Page, StudioState
from midair.studio.take_data import TakeData, facts, made_with, told_settings
from midair.studio.takes_list import TakesList
from midair.studio.work import SolveRequest, report_loop, settings_of, solve_take, stamp_of


class TakeNamed(BaseModel):
    """A take."""

    model_config = ConfigDict(extra="forbid")
    take: str = Field(max_length=1000)


class SolveForm(BaseModel):
    """How a drive is to be made; what is None is the mode's."""

    model_config = ConfigDict(extra="forbid")
    take: str = Field(max_length=1000)
    mode: Mode = "best"
    mapping: Literal["half-wave", "constant-offset", "slow-bias"] | None = None
    method: Literal["live", "fast", "exact", "lm", "glide"] | None = None
    level: Annotated[float, Field(gt=0, le=1)] | Literal["auto"] | None = None
    gain: float | None = Field(default=None, gt=0, le=100)
    height_mm: float | None = Field(default=None, ge=50, le=600)
    guard_mm: float | None = Field(default=None, ge=0, le=100)
    visible_s: float | None = Field(default=None, ge=0)
    replaces: str = Field(default="", max_length=100)

    def choices(self) -> tuple[tuple[str, Any], ...]:
        """What was chosen over the mode, in the settings' own units."""
        given = {
            "mapping": self.mapping,
            "method": self.method,
            "level": self.level,
            "gain": self.gain,
            "height": None if self.height_mm is None else self.height_mm * 1e-3,
            "guard": None if self.guard_mm is None else self.guard_mm * 1e-3,
        }
        return tuple((name, value) for name, value in given.items() if value is not None)


class JobNumber(BaseModel):
    """A job."""

    model_config = ConfigDict(extra="forbid")
    number: int


class ReproducePanel:
    """Takes and drives.

    Parameters
    ----------
    desk : Desk
        Orders come from it.
    takes : TakesList
        What there is.
    jobs, reading : Jobs
        The queue of long work, and that of quick looks into files.
    later : callable
        Has something done on the desk's loop, from any thread.
    first : mapping
        Facts of the stroke that is shown before there is a sample.
    """

    def __init__(
        self, desk: StudioState, takes: TakesList, jobs: Jobs, reading: Jobs, later: Any, first: Mapping[str, Any]
    ) -> None:
        self._desk, self._takes, self._jobs, self._reading, self._later = desk, takes, jobs, reading, later
        self._sampled, self._first = False, first
        desk.offer("reproduce", "open", self.open, TakeNamed, watchers=True)
        desk.offer("reproduce", "solve", self.solve, SolveForm)
        desk.offer("reproduce", "code", self.code, SolveForm, watchers=True)
        desk.offer("compare", "report", self.report, SolveForm)
        desk.offer("jobs", "cancel", self.cancel, JobNumber)
        self.show()

    def show(self) -> None:
        """Tell which takes there are."""
        self._desk.put(takes=self._takes.rows())

    async def open(self, _: Page, order: TakeNamed) -> Any:
        """Facts of a take."""
        if self._takes.comes(order.take):
            return {"stamp": "first", **self._first}
        scene = self._takes.scene(order.take)
        found = await result_of(self._reading, f"reading {order.take}", facts_of, scene)
        return {"stamp": scene.stamp, "part": scene.drive == self._takes.part(order.take), **found}

    def code(self, _: Page, order: SolveForm) -> dict[str, Any]:
        """The settings of an order, as a drive that is made with them tells them."""
        return told_settings(settings_of(self._wish(order)))

    async def solve(self, _: Page, order: SolveForm) -> dict[str, Any]:
        """Put the solving of a take into the queue; of a long one, first of the second that is in sight.

        Where a drive is there, or a re-recording, the answer is a question instead, and nothing is done; the order
        that has its stamp as `replaces` is the consent.
        """
        wish = self._wish(order)
        new = told_settings(settings_of(wish))["line"]  # refused now, rather than when its turn comes
        there = [path for path in (wish.drive, *(path for path, _ in wish.outdated)) if stamp_of(path)]
        stamp = "-".join(map(stamp_of, there))
        if there and order.replaces != stamp:
            told = f"reading {order.take}"
            made = await result_of(self._reading, told, made_with_of, wish.drive) if wish.replaces else ""
            return {"asks": {"files": [Path(path).name for path in there], "made": made, "new": new, "replaces": stamp}}
        return {"job": self._solve(order, wish).number}

    def _wish(self, order: SolveForm) -> SolveRequest:
        drive, again = (self._takes.beside(order.take, ending) for ending in (".drive.h5", ".rerecorded.h5"))
        return SolveRequest(
            take=str(self._takes.path(order.take)),
            drive=str(drive),
            mode=order.mode,
            choices=order.choices(),
            replaces=stamp_of(drive),
            outdated=((str(again), stamp_of(again)),),
        )

    def _solve(self, order: SolveForm, whole: SolveRequest) -> StudioJob:
        title, sight = f"solve {order.take}", f"solve the second in sight of {order.take}"
        for job in self._jobs.unfinished():
            if job.title in (title, sight):
                self._jobs.cancel(job.number)
        Path(self._takes.part(order.take)).unlink(missing_ok=True)
        if order.visible_s is not None:
            part = self._takes.part(order.take)
            first = replace(whole, drive=part, start=order.visible_s, duration=1.0, replaces="", outdated=())
            self._jobs.add(sight, solve_take, first, room="reproduce", ended=self._ended(order.take, title))
        return self._jobs.add(title, solve_take, whole, room="reproduce", ended=self._ended(order.take, title))

    def solve_sample(self) -> None:
        """Solve the first sample, so that there is something to see and to play from the first moment on."""
        rows = [row for row in self._takes.rows() if row["sample"] and not self._takes.comes(row["name"])]
        if rows and not rows[0]["solved"] and not self._sampled:
            self._sampled = True
            sample = SolveForm(take=rows[0]["name"], mode="paper", method="live", level="auto")
            self._solve(sample, self._wish(sample))

    def report(self, _: Page, order: SolveForm) -> dict[str, int]:
        """Put the whole loop on the virtual rig, and its report, into the queue."""
        target = self._takes.beside(order.take, ".report.html")
        take = str(self._takes.path(order.take))
        solve = SolveRequest(take=take, drive="", mode=order.mode, choices=order.choices())
        settings_of(solve)
        title = f"report of {order.take}"
        job = self._jobs.add(title, report_loop, (solve, str(target)), room="compare", ended=self._solved)
        return {"job": job.number}

    def cancel(self, _: Page, order: JobNumber) -> bool:
        """End a job."""
        if not self._jobs.cancel(order.number):
            raise InputError(f"job {order.number}: expected one that waits or runs; it has ended")
        return True

    def _ended(self, take: str, title: str) -> Any:
        def ended(job: StudioJob) -> None:
            # The second in sight is shown until the whole drive is there, or will not come.
            if title not in [each.title for each in self._jobs.unfinished()]:
                Path(self._takes.part(take)).unlink(missing_ok=True)
            if job.title == title and job.state == "done":
                # It was compared with what the drive before gave.
                self._takes.kept(take).unlink(missing_ok=True)
            self._solved(job)

        return ended

    def _solved(self, _: StudioJob) -> None:
        self._later(self.show)


def facts_of(scene: TakeData, _: Progressed) -> Any:
    """Facts of a scene, in the worker."""
    return facts(scene)


def made_with_of(drive: str, _: Progressed) -> str:
    """What a drive was made with, in the worker."""
    return made_with(drive)
