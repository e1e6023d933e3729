"""Panel Record: current signal of the sensor, and takes; packed sections for the pages, with flow control.

A page returns credit for each message that it drew. Sections for a slow page wait and are joined into one message, so
that its delay does not grow and no page waits for another.
"""

import asyncio
import itertools
import time
from collections import deque
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from midair.errors import DeviceStateError
from midair.rig import RecordSettings, Subject, last_subject, store_subject, take_path
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.sensor_process import run_sensor
from midair.studio.studio_state import Arguments, Page, declared
from midair.studio.worker_process import WorkerProcess

KEPT = 60.0
"""Seconds of sections that wait for a slow page; older ones are dropped, and the page shows a gap."""

REST = 2.0
"""Seconds after which a virtual sensor that no page shows is closed; it opens again for the next page."""


@dataclass(slots=True, eq=False)
class _Viewer:
    page: Page
    next: int
    fresh: asyncio.Event = field(default_factory=asyncio.Event)
    task: "asyncio.Task[None] | None" = None
    messages: "itertools.count[int]" = field(default_factory=lambda: itertools.count(1))


class Feed:
    """Sends packed sections to the pages."""

    def __init__(self) -> None:
        self._blocks: deque[list[bytes]] = deque()
        self._first = 0
        self._viewers: dict[int, _Viewer] = {}
        self._most = round(KEPT * 120)

    @property
    def waiting(self) -> int:
        """Number of blocks that some page has not received yet."""
        return len(self._blocks)

    @property
    def viewed(self) -> bool:
        """True if a page receives the sections."""
        return bool(self._viewers)

    def enter(self, page: Page) -> None:
        """Send to this page from now on."""
        self.leave(page)
        viewer = self._viewers[page.number] = _Viewer(page, self._first + len(self._blocks))
        viewer.task = asyncio.ensure_future(self._go(viewer))

    def leave(self, page: Page) -> None:
        """Stop sending to a page."""
        viewer = self._viewers.pop(page.number, None)
        if viewer is not None and viewer.task is not None:
            viewer.task.cancel()
        self._forget()

    def add(self, sections: list[bytes]) -> None:
        """Append the next sections."""
        self._blocks.append(sections)
        self._forget()
        for viewer in self._viewers.values():
            viewer.fresh.set()

    def remind(self, page: Page) -> None:
        """Send waiting sections to a page that may have returned credit."""
        if page.number in self._viewers:
            self._viewers[page.number].fresh.set()

    def close(self) -> None:
        """Stop sending."""
        for viewer in list(self._viewers.values()):
            self.leave(viewer.page)

    def _forget(self) -> None:
        """Drop the blocks that every page has received and those that are too old."""
        end = self._first + len(self._blocks)
        wanted = max(min((each.next for each in self._viewers.values()), default=end), end - self._most)
        while self._first < wanted:
            self._blocks.popleft()
            self._first += 1

    async def _go(self, viewer: _Viewer) -> None:
        # A closed socket is handled where it is read; that code calls `leave`.
        with suppress(Exception):
            while True:
                await viewer.fresh.wait()
                viewer.fresh.clear()
                begin = max(viewer.next, self._first)
                end = self._first + len(self._blocks)
                if viewer.page.credit <= 0 or begin >= end:
                    continue
                blocks = list(itertools.islice(self._blocks, begin - self._first, None))
                viewer.next = end
                viewer.page.credit -= 1
                self._forget()
                await viewer.page.wire.send_bytes(numbered(blocks, next(viewer.messages)))


def numbered(blocks: list[list[bytes]], number: int) -> bytes:
    """Join the sections of some blocks, each with the message number in bytes 4 to 8 of its header."""
    header = (number % 2**32).to_bytes(4, "little")
    return b"".join(section[:4] + header + section[8:] for block in blocks for section in block)


class Listen(Arguments):
    """Name of the sensor to read."""

    sensor: str = Field(min_length=3, max_length=300, pattern=r"^[a-z]+:")


class MakeTake(Arguments):
    """Record one take or several."""

    object: str = Field(default="", max_length=100)
    surface: str = Field(default="", max_length=100)
    speed: str = Field(default="", max_length=100)
    operator: str = Field(default="", max_length=100)
    start: Literal["at once", "touch"] = "at once"
    duration_s: float | None = declared(RecordSettings, "duration", most=3600)
    level: float | None = declared(RecordSettings, "level")
    pre_roll_s: float = declared(RecordSettings, "pre_roll")
    post_roll_s: float | None = declared(RecordSettings, "post_roll", most=60, default=None)
    repeats: int = declared(RecordSettings, "repeats", most=100)


class VisibleRange(Arguments):
    """Whether a page shows the panel now."""

    shown: bool


class RecordPanel(Panel):
    """The sensor process and its takes."""

    name, title, script, place = "record", "Record", WEB / "room-record.js", 2

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self._feed = Feed()
        self._sensor = WorkerProcess(
            run_sensor,
            self._on_message,
            name="sensor",
            absent="sensor: expected an open sensor, it is closed; choose it again",
            gone="",
            call=context.later,
        )
        self._named = context.sensor
        self._left_to_do: list[MakeTake] = []
        self._viewed = 0.0
        self._resting: asyncio.Future[None] | None = None
        store = context.store
        self._offer(sight=VisibleRange, watchers=True)
        self._offer(listen=Listen, take=MakeTake, toggle=Arguments)
        store.offer("calibrate", "taps", self.taps)
        store.alive.append(self._feed.remind)
        subject = asdict(last_subject())
        self._show(
            state="closed",
            sensor=self._named,
            events=[],
            take=None,
            error="",
            subject={name: subject[name] for name in ("object", "surface", "speed", "operator")},
        )
        store.put(levels=None, taps=None)

    def sight(self, page: Page, order: VisibleRange) -> bool:
        """Start or stop sending frames to a page; the first page opens the sensor."""
        page.credit = 24
        (self._feed.enter if order.shown else self._feed.leave)(page)
        if order.shown and not self._sensor.process:
            self._open()
        return True

    def left(self, page: Page) -> None:
        """Stop sending frames to a page that has gone."""
        self._feed.leave(page)

    async def listen(self, _: Page, order: Listen) -> bool:
        """Open another sensor, or the same one again."""
        if self._state["state"] in ("recording", "waiting"):
            raise DeviceStateError("sensor: expected no running take; stop it, then choose another sensor")
        self._named = order.sensor
        # The old process may take a second to end; the event loop must go on meanwhile.
        await asyncio.to_thread(self._sensor.close, 1.5)
        if not self._sensor.process:
            self._open()
        return True

    def take(self, _: Page, order: MakeTake) -> str:
        """Record a take, or several in sequence."""
        if not self._sensor.process or self._state["state"] != "listening":
            said = {"opens": "being opened; wait a moment"}.get(state := self._state["state"], state)
            raise DeviceStateError(f"record: expected an open sensor that is idle, it is {said}")
        if order.start == "touch" and order.level is None:
            raise DeviceStateError("trigger: expected a level for a take that waits for a touch, got none")
        self._left_to_do = [order] * order.repeats
        self._show(events=[], error="")
        return self._next()

    def toggle(self, _: Page, __: Arguments) -> bool:
        """End the running take, or begin the one that waits."""
        self._left_to_do = self._left_to_do if self._state["state"] == "waiting" else []
        self._sensor.send("toggle")
        return True

    def taps(self, _: Page, __: Arguments) -> bool:
        """Identify which channel belongs to which cell."""
        if self._state["state"] in ("recording", "waiting"):
            raise DeviceStateError("sensor: expected no running take; stop it, then identify the channels")
        if not self._sensor.process:
            self._open()
        self._store.put(taps={"state": "listens", "cell": None})
        self._sensor.send("taps")
        return True

    async def release(self) -> None:
        """Close the sensor for another process, until a page shows this panel; DeviceStateError during a take."""
        if self._state["state"] in ("recording", "waiting"):
            raise DeviceStateError("sensor: expected no running take; stop it, then start again")
        if self._sensor.process:
            self._show(state="closed")
            # It may take a second to end; the event loop must go on meanwhile.
            await asyncio.to_thread(self._sensor.close, 1.5)

    def close(self) -> None:
        """End the sensor process."""
        self._feed.close()
        self._sensor.close(1.5)

    def _next(self) -> str:
        order = self._left_to_do.pop(0)
        subject = Subject(object=order.object, surface=order.surface, speed=order.speed, operator=order.operator)
        store_subject(subject)
        path = take_path(self._takes.folder.path, subject, repeats=1)
        settings = RecordSettings(
            duration=order.duration_s,
            level=order.level if order.start == "touch" else None,
            pre_roll=order.pre_roll_s,
            post_roll=order.post_roll_s,
        )
        self._sensor.send("take", settings=settings, path=path, notes=subject.notes)
        self._show(
            state="waiting" if order.start == "touch" else "recording", name=path.name, left=len(self._left_to_do)
        )
        return path.name

    def _open(self) -> None:
        self._viewed = time.monotonic()
        self._sensor.start(self._named, self._context.seed)
        self._show(state="opens", sensor=self._named, error="", events=[])

    def _on_message(self, said: dict[str, Any]) -> None:
        kind = said.pop("kind")
        if kind == "frames":
            self._feed.add(said["data"])
        elif kind == "levels":
            if not self._named.startswith("virtual:") or self._feed.viewed or said["state"] != "listening":
                self._viewed = time.monotonic()
            elif time.monotonic() > self._viewed + REST:
                self._resting = asyncio.ensure_future(self.release())
                return
            if said["state"] != self._state["state"]:
                self._show(state=said["state"])
            self._store.put(levels=said)
        elif kind == "open":
            self._show(state="listening", about=said, error="")
        elif kind == "event":
            self._show(events=[*self._state["events"], said][-50:])
        elif kind == "taken":
            said["name"] = Path(said["path"]).name
            self._show(state="listening", take=said)
            self._context.show_takes()
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
        elif kind == "gone" and self._state["state"] not in ("lost", "closed"):
            self._show(state="lost", error="the sensor process ended unexpectedly; choose the sensor again")
