"""Panel Record: current signal of the sensor, and takes."""

import asyncio
import contextlib
import threading
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from midair.errors import DeviceStateError
from midair.rig import Subject, last_subject, store_subject, take_path
from midair.studio.feed import Feed
from midair.studio.sensor_process import TakeRequest, run_sensor
from midair.studio.studio_state import NoArguments, Page, StudioState
from midair.studio.takes_list import TakesList


class Listen(BaseModel):
    """Name of the sensor to read."""

    model_config = ConfigDict(extra="forbid")
    sensor: str = Field(min_length=3, max_length=300, pattern=r"^[a-z]+:")


class MakeTake(BaseModel):
    """Record one take or several."""

    model_config = ConfigDict(extra="forbid")
    object: str = Field(default="", max_length=100)
    surface: str = Field(default="", max_length=100)
    speed: str = Field(default="", max_length=100)
    operator: str = Field(default="", max_length=100)
    start: Literal["at once", "touch"] = "at once"
    duration_s: float | None = Field(default=None, gt=0, le=3600)
    level: float | None = Field(default=None, gt=0)
    pre_roll_s: float = Field(default=0.0, ge=0, le=60)
    post_roll_s: float | None = Field(default=None, gt=0, le=60)
    repeats: int = Field(default=1, ge=1, le=100)


class VisibleRange(BaseModel):
    """Whether a page shows the panel now."""

    model_config = ConfigDict(extra="forbid")
    shown: bool


class RecordPanel:
    """The sensor process and its takes; `taken` is called after each new take."""

    def __init__(self, store: StudioState, takes: TakesList, sensor: str, seed: int, later: Any, taken: Any) -> None:
        self._store, self._takes, self._sensor, self._seed = store, takes, sensor, seed
        self._later, self._taken = later, taken
        self._viewers: dict[int, Page] = {}
        self._feed = Feed(lambda: list(self._viewers.values()))
        self._process: Any = None
        self._pipe: Connection | None = None
        self._left_to_do: list[MakeTake] = []
        self.heard: dict[str, Any] = {}
        self._state: dict[str, Any] = {"state": "closed", "sensor": sensor, "events": [], "take": None, "error": ""}
        store.offer("record", "sight", self.sight, VisibleRange, watchers=True)
        store.offer("record", "listen", self.listen, Listen)
        store.offer("record", "take", self.take, MakeTake)
        store.offer("record", "toggle", self.toggle, NoArguments)
        store.offer("calibrate", "taps", self.taps, NoArguments)
        subject = last_subject()
        self._show(
            subject={
                "object": subject.object,
                "surface": subject.surface,
                "speed": subject.speed,
                "operator": subject.operator,
            }
        )
        store.put(levels=None, taps=None)

    def sight(self, page: Page, order: VisibleRange) -> bool:
        """Start or stop sending frames to a page; the first page opens the sensor."""
        if order.shown:
            page.credit = 24
            self._viewers[page.number] = page
            self._feed.leave(page)
            if self._process is None:
                self._open()
        else:
            self.left(page)
        return True

    def left(self, page: Page) -> None:
        """Stop sending frames to a page that has gone or shows another panel."""
        self._viewers.pop(page.number, None)
        self._feed.leave(page)

    async def listen(self, _: Page, order: Listen) -> bool:
        """Open another sensor, or the same one again."""
        if self._state["state"] in ("recording", "waiting"):
            raise DeviceStateError("sensor: expected no running take; stop it, then choose another sensor")
        self._sensor = order.sensor
        # The old process may take a second to end; the event loop must go on meanwhile.
        await asyncio.to_thread(self._close)
        if self._process is None:
            self._open()
        return True

    def take(self, _: Page, order: MakeTake) -> str:
        """Record a take, or several in sequence."""
        if self._pipe is None or self._state["state"] != "listening":
            raise DeviceStateError(f"record: expected an open sensor that is idle, its state is {self._state['state']}")
        if order.start == "touch" and order.level is None:
            raise DeviceStateError("trigger: expected a level for a take that waits for a touch, got none")
        self._left_to_do = [order] * order.repeats
        self._show(events=[], error="")
        return self._next()

    def toggle(self, _: Page, __: NoArguments) -> bool:
        """End the running take, or begin the one that waits."""
        self._left_to_do = self._left_to_do if self._state["state"] == "waiting" else []
        self._send("toggle")
        return True

    def taps(self, _: Page, __: NoArguments) -> bool:
        """Identify which channel belongs to which cell."""
        if self._process is None:
            self._open()
        self._store.put(taps={"state": "listens", "cell": None})
        self._send("taps")
        return True

    async def release(self) -> None:
        """Close the sensor for another process, until a page shows this panel; DeviceStateError during a take."""
        if self._state["state"] in ("recording", "waiting"):
            raise DeviceStateError("sensor: expected no running take; stop it, then start again")
        if self._process is not None:
            self._show(state="closed")
            # It may take a second to end; the event loop must go on meanwhile.
            await asyncio.to_thread(self._close)

    def close(self) -> None:
        """End the sensor process."""
        self._feed.close()
        self._close()

    def _next(self) -> str:
        order = self._left_to_do.pop(0)
        subject = Subject(object=order.object, surface=order.surface, speed=order.speed, operator=order.operator)
        store_subject(subject)
        path = take_path(self._takes.folder.path, subject, repeats=1)
        self._send(
            TakeRequest(
                path=str(path),
                start=order.start,
                duration=order.duration_s,
                level=order.level,
                pre_roll=order.pre_roll_s,
                post_roll=order.post_roll_s,
                notes=subject.notes,
            )
        )
        self._show(
            state="waiting" if order.start == "touch" else "recording", name=path.name, left=len(self._left_to_do)
        )
        return path.name

    def _open(self) -> None:
        context = get_context("spawn")
        self._pipe, there = context.Pipe()
        self._process = context.Process(
            target=run_sensor, args=(there, self._sensor, self._seed), name="midair sensor", daemon=True
        )
        self._process.start()
        there.close()
        self._show(state="opens", sensor=self._sensor, error="", events=[])
        threading.Thread(target=self._listen, args=(self._pipe,), name="sensor", daemon=True).start()

    def _close(self) -> None:
        process, pipe = self._process, self._pipe
        self._process = self._pipe = None
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.send("quit")
        if process is not None:
            process.join(1.5)
            if process.is_alive():
                process.terminate()
                process.join(2)

    def _send(self, what: Any) -> None:
        try:
            if self._pipe is None:
                raise OSError
            self._pipe.send(what)
        except OSError as wrong:
            raise DeviceStateError("sensor: expected an open sensor, it is closed; choose it again") from wrong

    def _listen(self, pipe: Connection) -> None:
        while True:
            try:
                said = pipe.recv()
            except (EOFError, OSError, TypeError):
                break
            self._later(self._on_message, pipe, said)
        self._later(self._on_message, pipe, {"kind": "gone"})

    def _on_message(self, pipe: Connection, said: dict[str, Any]) -> None:
        if pipe is not self._pipe:
            return
        kind = said.pop("kind")
        if kind == "frames":
            self._feed.add(said["first"], said["rows"])
        elif kind == "levels":
            if said["state"] != self._state["state"]:
                self._show(state=said["state"])
            self._store.put(levels=said)
        elif kind == "open":
            self._feed.start(said["rate_hz"])
            self._show(state="listening", about=said, error="")
        elif kind == "event":
            self._show(events=[*self._state["events"], said][-50:])
        elif kind == "taken":
            said["name"] = Path(said["path"]).name
            self._show(state="listening", take=said)
            self._taken()
            if self._left_to_do and said["end"] not in ("failure", "quit"):
                self._next()
        elif kind in ("lost", "failed"):
            self._left_to_do = []
            self._show(state="lost" if kind == "lost" else "listening", error=said["error"])
            if self._store.state.get("taps"):
                self._store.put(taps={"state": "failed", "error": said["error"]})
        elif kind == "tap":
            self._store.put(taps={"state": "listens", "cell": said["cell"]})
        elif kind == "identified":
            self._store.put(taps={"state": "done", **said})
        elif kind == "gone":
            self._process = self._pipe = None
            if self._state["state"] not in ("lost", "closed"):
                self._show(state="lost", error="the sensor process ended unexpectedly; choose the sensor again")

    def _show(self, **changes: Any) -> None:
        self._state = {**self._state, **changes}
        self._store.put(record=self._state)
