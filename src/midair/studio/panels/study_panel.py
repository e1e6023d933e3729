"""Panel Study: a participant's session, with a page for the experimenter and one for the participant."""

import asyncio
import threading
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from midair.errors import DeviceStateError, InputError, MidairError, StoppedError
from midair.model import Medium
from midair.studio.importing import run_words
from midair.studio.jobs import StudioJob, Work
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.studio_state import Arguments, Page
from midair.studio.take_data import stamp_of
from midair.studio.work import StudyRequest, draw_study
from midair.study import (
    Plan,
    Reply,
    Session,
    StimulusPresenter,
    StudyFolder,
    Template,
    check_digests,
    check_not_withdrawn,
    open_markers,
    study_code,
)


class NewStudy(Arguments):
    """Draw a study plan from a template."""

    name: str = Field(min_length=1, max_length=60, pattern=r"^\w[\w -]*$")
    template: Template = "paper"
    participants: int = Field(default=10, ge=1, le=500)
    takes: tuple[str, ...] = Field(default=(), max_length=20)
    questions: tuple[tuple[Annotated[str, Field(min_length=1, max_length=500)], bool], ...] = Field(
        default=(), max_length=5
    )
    """Texts, and whether each is a rating."""
    repetitions: int = Field(default=5, ge=1, le=100)


class StudyNamed(Arguments):
    """Name of a study."""

    study: str = Field(min_length=1, max_length=200)


class BeginSession(StudyNamed):
    """Study, participant and settings of a session."""

    participant: int = Field(ge=1, le=500)
    pilot: bool = False
    noise: str = Field(default="default", min_length=1, max_length=200)
    override: str = Field(default="", max_length=200)


class AnswerGiven(Arguments):
    """Answer of the participant."""

    turn: int
    text: str = Field(max_length=1000)
    reaction_s: float | None = Field(default=None, ge=0, le=86400)


class Reason(Arguments):
    """Reason for stopping a session."""

    reason: str = Field(max_length=200)


ASKED = ("text", "kind", "answers", "low_label", "high_label", "low", "high")
"""Attributes of a question that the page shows."""


SHOWN = ("kind", "text", "code", "number", "total", "rest_s", "consent")
"""Attributes of a step that the page shows."""


class StudyPanel(Panel):
    """Studies of the folder, and the running session."""

    name, title, script, place = "study", "Study", WEB / "room-study.js", 7

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self._folder, self._playing, self._later = context.takes.folder, context.playing, context.later
        self._session: Session | None = None
        self._begins = False
        self._confirmed, self._ended = threading.Event(), threading.Event()
        self._markers = ExitStack()
        # All calls of a session run in this thread, which may wait for a stimulus.
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="session")
        self._loop: asyncio.AbstractEventLoop | None = None
        self._about: dict[str, Any] = {}
        self._room: Medium | None = None
        self._turn, self._shown_step, self._masked = 0, object(), False
        store = context.store
        self._offer(list=Arguments, watchers=True)
        self._offer(new=NewStudy, analyse=StudyNamed, simulate=StudyNamed, begin=BeginSession)
        self._offer(presented=Arguments, end=Arguments)
        # The participant may use a second page, which has no control.
        self._offer(acknowledge=Arguments, present=Arguments, answer=AnswerGiven, stop=Reason, watchers=True)
        store.put(studies=[], session=None)

    async def list(self, _: Page, __: Arguments) -> bool:
        """Send the list of studies."""
        found = await asyncio.to_thread(self._studies)
        self._store.put(studies=found)
        return True

    def new(self, _: Page, order: NewStudy) -> dict[str, int]:
        """Draw a study plan and solve its drives, as a job."""
        path = self._folder.place(order.name)
        if path.exists():
            raise InputError(f"{order.name}: expected a new name, this one exists already")
        takes = tuple(str(self._folder.find(take)) for take in order.takes)
        got = f"{len(takes)} and {len(order.questions)}"
        if takes and order.template == "detection":
            if len(takes) > 1 or order.questions:
                raise InputError(f"study: expected one take and no question for a threshold, got {got}")
        elif takes and (len(takes) < 2 or not order.questions):
            raise InputError(f"study: expected two or more takes and one or more questions, got {got}")
        request = StudyRequest(path=str(path), takes=takes, **order.model_dump(exclude={"name", "takes"}))
        return self._job(f"draw the study {order.name}", draw_study, request)

    def analyse(self, _: Page, order: StudyNamed) -> dict[str, int]:
        """Analyse a study and write its report, as a job."""
        words = ("study", "analyse", str(self._folder.find(order.study)))
        return self._job(f"analyse the study {order.study}", run_words, words)

    def simulate(self, _: Page, order: StudyNamed) -> dict[str, int]:
        """Simulate the answers of all participants of a study without answers, as a job."""
        path = self._folder.find(order.study)
        if any(state.trials for state in StudyFolder(path).sessions()):
            raise InputError(f"{order.study}: expected a study without answers; draw another plan and simulate that")
        words = ("study", "run", str(path), "--simulate")
        return self._job(f"simulate participants of {order.study}", run_words, words)

    def _job(self, title: str, work: Work, order: Any) -> dict[str, int]:
        """Add a job that changes a study; the list of studies is sent again at its end."""

        def ended(_: StudioJob) -> None:
            self._later(lambda: self._store.put(studies=self._studies()))

        return {"job": self._context.jobs.add(title, work, order, room="study", ended=ended).number}

    async def begin(self, _: Page, order: BeginSession) -> bool:
        """Begin a participant's session, or resume an interrupted one."""
        if self._session is not None or self._begins:
            raise DeviceStateError("study: expected no running session; end it first")
        self._begins = True
        try:
            return await self._begin(order)
        finally:
            self._begins = False

    async def _begin(self, order: BeginSession) -> bool:
        study = StudyFolder(self._folder.find(order.study))
        plan = await asyncio.to_thread(study.plan)
        if order.participant > plan.design.participants:
            raise InputError(f"participant: expected 1 to {plan.design.participants}, got {order.participant}")
        await asyncio.to_thread(check_not_withdrawn, study, order.participant)
        self._loop = asyncio.get_running_loop()
        self._room = self._context.air.medium
        quiet = await self._get_ready(study, plan, order)
        log = study.log(order.participant)
        if order.pilot:
            # A folder that no analysis reads, so that pilot data cannot be mistaken for data of the study.
            log = study.path / "pilot" / log.name
        self._ended.clear()
        presenter = StimulusPresenter(
            tell=self._tell,
            done=self._wait_for_experimenter,
            show=lambda shown: self._later(
                lambda: self._show(media=shown and {"kind": shown.kind, "source": shown.source})
            ),
            play=lambda source, share: self._play(study.path / source, share, study_code(study, order.participant)),
            wait=self._wait if quiet else None,
            silence_s=quiet,
            stop=self._playing.lease.stop,
            folder=study.path,
            ended=self._ended,
        )
        drives = any(stimulus.kind == "drive" for stimulus in plan.design.stimuli)
        markers = self._markers.enter_context(open_markers(plan))
        session = Session(
            plan,
            order.participant,
            log,
            presenter,
            markers=markers,
            room=self._room,
            simulated=drives and bool(self._store.state["player"]["simulated"]),
            about={
                "pilot": order.pilot,
                "array": self._store.state["player"]["device"] if drives else None,
                "noise_dbfs": plan.design.noise.level_dbfs if self._masked and plan.design.noise else None,
                **({} if markers is None else {"markers": markers.outputs.said}),
            },
        )
        try:
            await self._do(session.__enter__)
        except BaseException:
            self._markers.close()
            raise
        self._session = session
        self._about = {
            "study": order.study,
            "title": plan.design.title or plan.design.name,
            "participant": order.participant,
            "pilot": order.pilot,
            "due": "",
            "cue": "",
            "media": None,
            "busy": False,
            "log": [],
            "error": "",
        }
        self._show()
        return True

    async def _get_ready(self, study: StudyFolder, plan: Plan, order: BeginSession) -> float:
        """Check drives and open the headphones; returns the duration of the longest drive in s."""
        drives = dict.fromkeys((one.source, one.share) for one in plan.design.stimuli if one.kind == "drive")
        self._masked = False
        await asyncio.to_thread(check_digests, study.path, plan.drives, plan.design.stimuli)
        if not drives:
            return 0.0
        noise = plan.design.noise if order.noise != "none" else None
        await self._playing.mask(noise, order.noise)
        by = order.override.strip()
        found = [
            await self._playing.admit_trial(study.path / source, share, override=by, room=self._room)
            for source, share in drives
        ]
        self._masked = noise is not None
        return max(each["duration_s"] for each in found)

    async def acknowledge(self, _: Page, __: Arguments) -> bool:
        """Continue after a text or a break."""
        await self._do(self._open().acknowledge)
        self._show()
        return True

    async def present(self, _: Page, __: Arguments) -> bool:
        """Present the next stimulus; answers when it is over."""
        session = self._open()
        if self._about["busy"]:
            raise DeviceStateError("study: expected no running presentation; wait for its end")
        number = session.step.number
        self._playing.begin_presentation()
        self._show(busy=True, error="")
        try:
            await self._do(lambda: session.present(lambda text: self._later(lambda: self._show(cue=text))))
            if result := {"ask": "presented", "show": "failed, to be repeated"}.get(session.step.kind):
                self._note(f"trial {number} {result}")
        except MidairError as wrong:
            self._show(error=str(wrong))
            raise
        finally:
            if self._session is session:
                self._show(busy=False, due="", cue="", media=None)
        return True

    async def answer(self, _: Page, order: AnswerGiven) -> bool:
        """Store an answer; the reply is sent after it is on disk."""
        session = self._open()
        if order.turn != self._turn:
            raise DeviceStateError("study: expected an answer to the current question, got one to an earlier question")
        asked = f"trial {session.step.number}" if session.step.number else "form"
        await self._do(lambda: session.answer(Reply(text=order.text, reaction_s=order.reaction_s, by="page")))
        self._note(f"{asked}: answered")
        self._show()
        return True

    def presented(self, _: Page, __: Arguments) -> bool:
        """Confirm that the experimenter has presented the object."""
        self._open()
        self._confirmed.set()
        return True

    async def stop(self, _: Page, order: Reason) -> bool:
        """Stop the session: silence first, then a line in the log."""
        session = self._open()
        # Not in the session's thread, which may be waiting for a stimulus to end.
        await asyncio.to_thread(session.stop, order.reason)
        self._note(f"stopped: {order.reason}")
        self._show()
        return True

    async def end(self, page: Page, _: Arguments) -> bool:
        """Leave the session; it can be resumed."""
        session = self._open()
        if session.step.kind not in ("done", "stopped"):
            await asyncio.to_thread(session.stop, "left by the experimenter")
        await self._do(lambda: session.__exit__(None, None, None))
        self._markers.close()
        self._session = None
        self._store.put(session=None)
        if self._masked:
            await self._playing.mask(None, "")
        return await self.list(page, Arguments())

    def close(self) -> None:
        """Stop the session as an interrupted one, when the studio ends."""
        session, self._session, self._loop = self._session, None, None
        if session is not None:
            session.stop("the studio was ended")
            self._thread.submit(session.__exit__, None, None, None)
        self._thread.shutdown(wait=True)
        self._markers.close()

    def _studies(self) -> Any:
        rows: list[dict[str, Any]] = []
        for path in sorted(self._folder.path.iterdir()):
            if not (path / "plan.json").is_file():
                continue
            study = StudyFolder(path)
            try:
                plan, begun = study.plan(), {s.trials[0].participant: s for s in study.sessions() if s.trials}
            except (MidairError, OSError) as wrong:
                rows.append({"name": path.name, "title": str(wrong), "participants": [], "noise": "", "drives": 0})
                continue
            trials = {n: sum(t.participant == n for t in plan.trials) for n in range(1, plan.design.participants + 1)}
            people = [
                {"number": n, "done": begun[n].next_trial if n in begun else 0, "total": total}
                for n, total in trials.items()
            ]
            noise = "" if plan.design.noise is None else plan.design.noise.said
            title = plan.design.title or plan.design.name
            report = stamp_of(path / "report.html")
            row: dict[str, Any] = {"name": path.name, "title": title, "participants": people, "noise": noise}
            row |= {"report": report, "simulated": any(state.simulated for state in begun.values())}
            rows.append({**row, "drives": sum(one.kind == "drive" for one in plan.design.stimuli)})
        return rows

    async def _do(self, act: Callable[[], Any]) -> Any:
        """Run a function in the session's thread."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, act)

    def _open(self) -> Session:
        if self._session is None:
            raise DeviceStateError("study: expected a running session, there is none; begin one")
        return self._session

    def _tell(self, said: str) -> None:
        self._later(lambda: self._show(due=said))

    def _wait_for_experimenter(self) -> None:
        """Wait until the experimenter confirms the presentation; runs in the session's thread."""
        self._confirmed.clear()
        while not (self._confirmed.wait(0.1) or self._ended.is_set()):
            pass
        self._tell("")

    def _play(self, path: Path, share: float, participant: str) -> None:
        """Play a drive and wait; runs in the session's thread."""
        how: dict[str, Any] = {"masked": self._masked, "participant": participant, "room": self._room}
        self._present(lambda: self._playing.present(path, share, **how))

    def _wait(self, seconds: float) -> None:
        """Present silence and wait; runs in the session's thread."""
        self._present(lambda: self._playing.quiet(seconds, masked=self._masked))

    def _present(self, begin: Callable[[], Coroutine[Any, Any, Any]]) -> None:
        done = asyncio.run_coroutine_threadsafe(begin(), self._running_loop())
        # While the studio ends, the event loop waits for this thread and never finishes the presentation.
        while not wait((done,), 0.1).done:
            self._running_loop()
        done.result()

    def _running_loop(self) -> asyncio.AbstractEventLoop:
        if self._loop is None:
            raise StoppedError("study: the studio is closing")
        return self._loop

    def _note(self, said: str) -> None:
        self._about["log"] = [*self._about["log"], said][-30:]

    def _show(self, **changes: Any) -> None:
        session = self._session
        if session is None:
            return
        self._about = {**self._about, **changes}
        step = session.step
        question = step.question
        if step is not self._shown_step:
            # The turn identifies a question, so that an answer that was sent twice is refused.
            self._turn, self._shown_step = self._turn + 1, step
        self._store.put(
            session={
                **self._about,
                "step": {
                    **{name: getattr(step, name) for name in SHOWN},
                    "turn": self._turn,
                    "question": question and {name: getattr(question, name) for name in ASKED},
                },
            }
        )
