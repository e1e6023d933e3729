"""Panel Live: plays the sensor's signal as it comes, after an exposure check and a held button."""

import asyncio
import contextlib
import itertools
import threading
from dataclasses import fields
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from midair.devices import ExposureChoices
from midair.errors import DeviceStateError, InputError, MidairError
from midair.files import DEFAULT_PROFILE, profile_named
from midair.rig import LiveMapping, LiveSettings, Subject, take_path
from midair.studio.live_feed import LiveFeed
from midair.studio.live_process import REMEMBERED, run_live
from midair.studio.panels.play_panel import PlayPanel
from midair.studio.panels.record_panel import RecordPanel, VisibleRange
from midair.studio.studio_state import NoArguments, Page, StudioState
from midair.studio.takes_list import TakesList


def _declared(name: str, factor: float = 1.0) -> Any:
    """A number with the default and the limits of a field of `LiveSettings`, in a unit `factor` times smaller."""
    told: Any = {one.name: one for one in fields(LiveSettings)}[name]
    low, high = (factor * each for each in told.metadata["limits"])
    return Field(default=factor * told.default, le=high, **{"gt" if told.metadata["above"] else "ge": low})


class CheckLive(BaseModel):
    """Settings to check before live touch starts."""

    model_config = ConfigDict(extra="forbid")
    sensor: str = Field(min_length=3, max_length=300, pattern=r"^[a-z]+:")
    calibration: str = Field(default="", max_length=1000)
    mapping: LiveMapping = "half-wave"
    delay_ms: float = _declared("delay", 1e3)
    hold_ms: float = _declared("hold", 1e3)
    gain: float = _declared("gain")
    height_mm: float = _declared("height", 1e3)
    level: float = _declared("level")
    profile: str = Field(default="", max_length=100)
    attenuate: bool = False
    override: str = Field(default="", max_length=200)


class BeginLive(BaseModel):
    """Start checked settings, after the button was held."""

    model_config = ConfigDict(extra="forbid")
    admission: int


class SetLevel(BaseModel):
    """Share of the checked level to play now."""

    model_config = ConfigDict(extra="forbid")
    share: float = Field(gt=0, le=1)


class KeepLast(BaseModel):
    """Save the last seconds as a take."""

    model_config = ConfigDict(extra="forbid")
    seconds: float = Field(default=REMEMBERED, gt=0, le=REMEMBERED)


class LivePanel:
    """Live touch: borrows the array from `playing` and the sensor from `record`."""

    def __init__(
        self,
        store: StudioState,
        takes: TakesList,
        playing: PlayPanel,
        record: RecordPanel,
        seed: int,
        later: Any,
        taken: Any,
    ) -> None:
        self._store, self._takes, self._playing, self._record = store, takes, playing, record
        self._seed, self._later, self._taken = seed, later, taken
        self.feed = LiveFeed()
        self._process: Any = None
        self._pipe: Connection | None = None
        self._closed = False
        self._numbers = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[Any]] = {}
        self._checked: dict[int, dict[str, Any]] = {}
        self._tasks: set[asyncio.Task[Any]] = set()
        self._state: dict[str, Any] = {"state": "idle", "said": "", "share": 1.0, "take": None, "calibrations": []}
        store.offer("live", "sight", self.sight, VisibleRange, watchers=True)
        store.offer("live", "check", self.check, CheckLive)
        store.offer("live", "begin", self.begin, BeginLive)
        store.offer("live", "turn", self.turn, SetLevel)
        store.offer("live", "keep", self.keep, KeepLast)
        store.offer("live", "end", self.end, NoArguments)
        store.alive.append(self.feed.remind)
        store.put(live=self._state)

    def sight(self, page: Page, order: VisibleRange) -> bool:
        """Start or stop sending frames to a page."""
        if order.shown:
            page.credit = 24
            self.feed.enter(page)
            self._show(calibrations=self._takes.folder.names(".calibration.h5"))
        else:
            self.feed.leave(page)
        return True

    def left(self, page: Page) -> None:
        """Stop sending frames to a page that has gone."""
        self.feed.leave(page)

    async def check(self, _: Page, order: CheckLive) -> Any:
        """Return the worst-case exposure of a level."""
        self._idle()
        given = order.model_dump(include={"sensor", "mapping", "gain", "level"})
        request: dict[str, Any] = {
            **given,
            "device": self._playing.device,
            "delay": 1e-3 * order.delay_ms,
            "hold": 1e-3 * order.hold_ms,
            "height": 1e-3 * order.height_mm,
            "calibration": self._takes.folder.find(order.calibration) if order.calibration else None,
            "exposure": ExposureChoices(
                profile=profile_named(order.profile or DEFAULT_PROFILE),
                attenuate=order.attenuate,
                override=order.override.strip() or None,
            ),
            "seed": self._seed,
        }
        found = await self._ask(do="check", request=request)
        self._checked = {found["number"]: request} if found["number"] else {}
        self._store.put(exposure={"take": "", **found})
        return found

    async def begin(self, page: Page, order: BeginLive) -> Any:
        """Borrow array and sensor, arm, and start; answers when it plays."""
        self._idle()
        request = self._checked.pop(order.admission, None)
        if request is None:
            raise DeviceStateError("live: expected settings that were just checked; check the exposure again")
        await self._record.release()
        leave = await self._playing.lend(page, f"live {request['sensor']}")
        self._show(state="opens", said="", share=1.0, take=None)
        self._store.put(live_goes=None)
        try:
            about = await self._ask(do="begin", admission=order.admission, leave=leave)
        except MidairError as wrong:
            await self._over(str(wrong))
            raise
        # A new number makes the pages clear their pictures, also when the settings are the same.
        about["run"] = next(self._numbers)
        self._store.put(live_about=about)
        self._show(state="plays")
        return True

    def turn(self, _: Page, order: SetLevel) -> bool:
        """Set the share of the checked level; it can never be louder."""
        self._plays()
        self._playing.permit.turn(order.share)
        self._show(share=order.share)
        return True

    async def keep(self, _: Page, order: KeepLast) -> Any:
        """Save the last seconds as a take that Reproduce opens."""
        about = self._store.state.get("live_about")
        if self._process is None or not about:
            raise InputError("keep: expected recorded frames, there are none yet; start live touch first")
        notes = Subject(object="live", surface=about["sensor"].partition(":")[2][:40])
        path = take_path(self._takes.folder.path, notes, repeats=1)
        found = await self._ask(do="keep", seconds=order.seconds, path=str(path), notes=dict(notes.notes))
        self._show(take=found)
        self._taken()
        return found

    def end(self, _: Page, __: NoArguments) -> bool:
        """Fade out and end."""
        if self._state["state"] == "opens":
            self._playing.permit.stop()
        elif self._state["state"] == "plays":
            self._send(do="end", id=0)
        return True

    def close(self) -> None:
        """End the process."""
        self._closed = True
        self.feed.close()
        if self._process is None:
            return
        self._playing.permit.stop()
        with contextlib.suppress(OSError):
            if self._pipe is not None:
                self._pipe.close()
        self._process.join(3)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(2)

    def _idle(self) -> None:
        if self._state["state"] != "idle":
            raise DeviceStateError("live: expected no running live touch, one is running; end it, then start again")

    def _plays(self) -> None:
        if self._state["state"] != "plays":
            raise DeviceStateError("live: expected running live touch, none is running; start it first")

    def _start(self) -> None:
        context = get_context("spawn")
        self._pipe, there = context.Pipe()
        arguments = (there, self._playing.permit)
        # Not a daemon, since it has a child process. It ends when its studio does.
        self._process = context.Process(target=run_live, args=arguments, name="midair live watch")
        self._process.start()
        there.close()
        threading.Thread(target=self._listen, args=(self._pipe,), name="live", daemon=True).start()

    def _send(self, **order: Any) -> None:
        try:
            if self._pipe is None:
                raise OSError
            self._pipe.send(order)
        except OSError as wrong:
            raise DeviceStateError("live: expected a running process, it has ended; start again") from wrong

    async def _ask(self, **order: Any) -> Any:
        if self._process is None:
            self._start()
        number = next(self._numbers)
        done: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._waiting[number] = done
        try:
            self._send(id=number, **order)
            return await done
        finally:
            self._waiting.pop(number, None)

    def _listen(self, pipe: Connection) -> None:
        while True:
            try:
                said = pipe.recv()
            except (EOFError, OSError, TypeError):
                break
            self._later(self._on_message, pipe, said)
        if not self._closed:
            self._later(self._on_message, pipe, {"kind": "gone"})

    def _on_message(self, pipe: Connection, said: dict[str, Any]) -> None:
        """Handle a message of the process."""
        if pipe is not self._pipe:
            return
        match said["kind"]:
            case "frames":
                self.feed.add(said["data"])
            case "goes":
                self._store.put(live_goes={**said["goes"], "remembered": said["remembered"]})
                self._playing.emits(said["emitting"])
            case "answer":
                if (waits := self._waiting.get(said["id"])) is not None and not waits.done():
                    waits.set_result(said["value"])
            case "wrong":
                if (waits := self._waiting.get(said["id"])) is not None and not waits.done():
                    waits.set_exception(InputError(said["error"]))
            case "ended":
                if said["goes"]:
                    self._store.put(live_goes={**(self._store.state.get("live_goes") or {}), **said["goes"]})
                self._do(self._over(said["error"] or "ended normally, with a fade-out"))
            case _:
                self._gone()

    def _gone(self) -> None:
        self._process = self._pipe = None
        gone = "live: the process ended, so the loop went silent; start again"
        for waits in self._waiting.values():
            if not waits.done():
                waits.set_exception(DeviceStateError(gone))
        if self._state["state"] == "plays":
            self._do(self._over(gone))

    async def _over(self, said: str) -> None:
        self._show(state="ends", said=said)
        await self._playing.take_back(said)
        self._show(state="idle")

    def _do(self, work: Any) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _show(self, **changes: Any) -> None:
        self._state = {**self._state, **changes}
        self._store.put(live=self._state)
