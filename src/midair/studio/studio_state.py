"""The desk: what is known now, which pages look at it, and what they order. Lives on the server's one event loop."""

import asyncio
import json
import time
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Protocol

from pydantic import BaseModel, ConfigDict, ValidationError

from midair.errors import MidairError
from midair.studio.control import Control

LARGEST_ORDER = 2**20
"""Bytes of an order, at most."""

ORDERS_A_SECOND = 100
"""Of one page; "alive" and credits are not counted."""


class Envelope(BaseModel):
    """Around every order."""

    model_config = ConfigDict(extra="forbid")

    id: int
    room: str
    order: str
    with_: dict[str, Any] = {}


class Wire(Protocol):
    """The socket of a page."""

    async def send_text(self, data: str) -> None:
        """Send state."""
        ...

    async def send_bytes(self, data: bytes) -> None:
        """Send frames."""
        ...


@dataclass(slots=True, eq=False)
class Page:
    """A page that is open.

    Attributes
    ----------
    number : int
        From 1 on.
    wire : Wire
        Its socket.
    visible : bool
        Whether somebody can see it, by its own word.
    room : str
        Where it is.
    heard : float
        When it said last that it is alive.
    credit : int
        Messages of frames that may still be under way.
    """

    number: int
    wire: Wire
    visible: bool = True
    room: str = ""
    heard: float = 0.0
    credit: int = 24
    recent: deque[float] = field(default_factory=lambda: deque[float](maxlen=ORDERS_A_SECOND))
    waiting: "asyncio.Queue[str]" = field(default_factory=lambda: asyncio.Queue[str](256))


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestKind:
    """An order that a room knows.

    Attributes
    ----------
    model : type of BaseModel
        What comes with it.
    act : callable
        Does it: given the page and the checked model, gives what to answer.
    watchers : bool
        Whether a page without control may order it.
    """

    model: type[BaseModel]
    act: Callable[[Page, Any], Awaitable[Any] | Any]
    watchers: bool = False


class NoArguments(BaseModel):
    """An order that comes alone."""

    model_config = ConfigDict(extra="forbid")


class StudioState:
    """State, pages and orders.

    Parameters
    ----------
    sounding : callable
        Whether something sounds now.
    """

    def __init__(self, sounding: Callable[[], bool]) -> None:
        self.control = Control(sounding=sounding)
        self.pages: dict[int, Page] = {}
        self.state: dict[str, Any] = {}
        self._number = 0
        self._pages = 0
        self._orders: dict[tuple[str, str], RequestKind] = {}
        self.left: list[Callable[[Page, bool], None]] = []
        self.alive: list[Callable[[Page], None]] = []

    def offer(
        self,
        room: str,
        order: str,
        act: Callable[[Page, Any], Awaitable[Any] | Any],
        model: type[BaseModel] = NoArguments,
        *,
        watchers: bool = False,
    ) -> None:
        """Take orders of a kind from now on."""
        self._orders[room, order] = RequestKind(model=model, act=act, watchers=watchers)

    def put(self, **sections: Any) -> None:
        """Change sections of the state, and tell every page."""
        changed = {name: value for name, value in sections.items() if self.state.get(name) != value}
        if not changed:
            return
        self.state |= changed
        self._number += 1
        self._tell(json.dumps({"number": self._number, "set": changed}))

    def enter(self, wire: Wire) -> Page:
        """A page is there; it gets the whole state first."""
        self._pages += 1
        page = Page(number=self._pages, wire=wire, heard=time.monotonic())
        self.pages[page.number] = page
        self.control.enter(page.number)
        self.whole(page)
        self.show_control()
        return page

    def leave(self, page: Page) -> None:
        """A page is gone."""
        self.pages.pop(page.number, None)
        had = self.control.leave(page.number)
        for tell in self.left:
            tell(page, had)
        self.show_control()

    def whole(self, page: Page) -> None:
        """Send everything that is known, for a page that came or missed something."""
        self._queue(page, json.dumps({"number": self._number, "page": page.number, "whole": self.state}))

    def show_control(self) -> None:
        """Tell who has control."""
        control = self.control
        self.put(control={"holder": control.holder, "asking": control.asking, "pages": sorted(self.pages)})

    async def hear(self, page: Page, text: str) -> None:
        """Take what a page said."""
        try:
            said = json.loads(text)
        except ValueError:
            return
        if not isinstance(said, dict):
            return
        if "alive" in said:
            page.heard, page.visible = time.monotonic(), bool(said["alive"])
            for tell in self.alive:
                tell(page)
            return
        if "drew" in said:
            page.credit = min(24, page.credit + int(said["drew"])) if isinstance(said["drew"], int) else page.credit
            return
        if "whole" in said:
            self.whole(page)
            return
        await self._order(page, said)

    async def _order(self, page: Page, said: dict[str, Any]) -> None:
        number = said.get("id") if isinstance(said.get("id"), int) else 0
        answer: dict[str, Any] = {"id": number}
        try:
            now = time.monotonic()
            if len(page.recent) == ORDERS_A_SECOND and now - page.recent[0] < 1:
                answer["error"] = f"expected at most {ORDERS_A_SECOND} orders a second, got more; slow down"
            else:
                page.recent.append(now)
                answer["ok"] = await self._act(page, said)
        except ValidationError as wrong:
            first = wrong.errors()[0]
            where = ".".join(str(part) for part in first["loc"])
            answer["error"] = f"order: {where}: {first['msg']}".replace(": :", ":")
        except MidairError as wrong:
            answer["error"], answer["kind"] = str(wrong), type(wrong).__name__
        except OSError as wrong:
            answer["error"] = f"{wrong.strerror or type(wrong).__name__}"
        self._queue(page, json.dumps(answer))

    async def _act(self, page: Page, said: dict[str, Any]) -> Any:
        order = Envelope.model_validate({("with_" if key == "with" else key): value for key, value in said.items()})
        kind = self._orders.get((order.room, order.order))
        if kind is None:
            from midair.errors import InputError

            raise InputError(f"order: expected one that this studio knows, got {order.room}.{order.order}")
        model = kind.model.model_validate(order.with_)
        if not kind.watchers:
            self.control.check(page.number)
        done = kind.act(page, model)
        return await done if isinstance(done, Awaitable) else done

    def _tell(self, text: str) -> None:
        for page in list(self.pages.values()):
            self._queue(page, text)

    def _queue(self, page: Page, text: str) -> None:
        try:
            page.waiting.put_nowait(text)
        except asyncio.QueueFull:
            # A page that takes nothing is told everything anew when it comes back to it.
            with suppress(asyncio.QueueEmpty):
                while True:
                    page.waiting.get_nowait()
            self.whole(page)
