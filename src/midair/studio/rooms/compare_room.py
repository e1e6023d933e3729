"""Room Compare: the original over what came back, figures of it, and a correction that can be applied."""

from typing import Any

from midair.errors import InputError
from midair.studio.desk import Desk, Page
from midair.studio.jobs import Jobs, StudioJob
from midair.studio.rooms.reproduce_room import TakeNamed
from midair.studio.takes_list import TakesList
from midair.studio.work import compare_takes, palm_of_take


class CompareRoom:
    """Comparisons of this session.

    Parameters
    ----------
    desk : Desk
        Orders come from it.
    takes : TakesList
        Originals and re-recordings.
    jobs : Jobs
        The queue of long work.
    played : list
        Whom to tell when something was played and re-recorded.
    later : callable
        Has something done on the desk's loop, from any thread.
    """

    def __init__(self, desk: Desk, takes: TakesList, jobs: Jobs, played: Any, later: Any) -> None:
        self._desk, self._takes, self._jobs, self._later = desk, takes, jobs, later
        self._found: dict[str, Any] = {}
        self._palms: dict[str, Any] = {}
        desk.offer("compare", "compare", self.compare, TakeNamed)
        desk.offer("compare", "palm", self.palm, TakeNamed)
        played.played.append(self._played)
        desk.put(comparisons={}, palms={})

    def compare(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Compare a take with what was re-recorded of it."""
        again = self._takes.beside(order.take, ".rerecorded.h5")
        if not again.exists():
            raise InputError(f"{order.take}: expected a take that was played and re-recorded; play it first")
        return {"job": self._start(order.take).number}

    def palm(self, _: Page, order: TakeNamed) -> dict[str, int]:
        """Simulate what a whole palm gets of a take's drive."""
        drive = self._takes.beside(order.take, ".drive.h5")
        if not drive.exists():
            raise InputError(f"{order.take}: expected a take that was solved; solve it first")
        job = self._jobs.add(
            f"the palm under {order.take}",
            palm_of_take,
            (str(self._takes.path(order.take)), str(drive)),
            room="compare",
            ended=lambda job: self._later(self._pressed, order.take, job),
        )
        return {"job": job.number}

    def _pressed(self, take: str, job: StudioJob) -> None:
        if job.state == "done":
            self._palms = {**self._palms, take: job.result}
            self._desk.put(palms=self._palms)

    def _played(self, take: str) -> None:
        """What was just played is compared without being asked."""
        if self._takes.beside(take, ".rerecorded.h5").exists():
            self._start(take)
        self._desk.put(takes=self._takes.rows())

    def _start(self, take: str) -> StudioJob:
        order = (
            str(self._takes.path(take)),
            str(self._takes.beside(take, ".rerecorded.h5")),
            str(self._takes.kept(take)),
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
            self._desk.put(comparisons=self._found, takes=self._takes.rows())
