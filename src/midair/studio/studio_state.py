"""State of the studio, the pages that show it, which has control, their requests; all on the server's event loop."""

import asyncio
import json
import math
import time
import traceback
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field, fields
from typing import Any, Protocol

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from midair.errors import DeviceStateError, InputError, MidairError, MissingFileError
from midair.files import json_of


@dataclass(slots=True, kw_only=True)
class Control:
    """Numbers of the page that has control and of the page that requests it; 0 for none."""

    sounding: Callable[[], bool]
    """True while something plays; control then changes only with consent of its holder."""
    holder: int = 0
    asking: int = 0

    def enter(self, page: int) -> None:
        """Give control to a new page if no page has it."""
        if not self.holder:
            self.holder = page

    def leave(self, page: int) -> None:
        """Remove a page; if it had control, that is then free."""
        self.asking = 0 if self.asking == page else self.asking
        self.holder = 0 if self.holder == page else self.holder

    def check(self, page: int) -> None:
        """Raise DeviceStateError unless a page has control."""
        if self.holder != page:
            who = "another page has control" if self.holder else "no page has control"
            raise DeviceStateError(f"this page may only watch: {who}; take control first")

    def take(self, page: int) -> bool:
        """Give control to a page and return True, or ask the holder first while something plays."""
        if self.holder == page:
            return True
        if self.holder and self.sounding():
            self.asking = page
            return False
        self.holder, self.asking = page, 0
        return True

    def give(self, page: int, *, to: int) -> None:
        """Hand control to the page that requested it; DeviceStateError if it no longer requests it."""
        self.check(page)
        if to != self.asking or not to:
            raise DeviceStateError("control: expected a page that requests it, got none")
        self.holder, self.asking = to, 0

    def refuse(self, page: int) -> None:
        """Keep control and drop the request."""
        self.check(page)
        self.asking = 0


LARGEST_ORDER = 2**20
"""Largest request in bytes."""

_PATTERNS = {"name": "letters, digits, spaces, _ and -, a letter or digit first", "sensor": "one such as lsl:NAME"}

MESSAGES_A_SECOND = 300
"""Messages of a page, of any kind, that are read in a second; 4 KiB more of a message count as one more."""


class Arguments(BaseModel):
    """Arguments of a request, checked; by itself, none."""

    model_config = ConfigDict(extra="forbid")


def declared(kind: Any, name: str, factor: float = 1.0, *, most: float = math.inf, **other: Any) -> Any:
    """An argument with the default and the limits of a setting, in a unit `factor` times smaller.

    `most` is a smaller upper limit, `default` another default.
    """
    known: Any = {one.name: one for one in fields(kind)}[name]
    low, high = (factor * each for each in known.metadata["limits"])
    # 1 stays a whole number.
    default = known.default if known.default is None or factor == 1 else factor * known.default
    made: Any = {"gt" if known.metadata["above"] else "ge": low, "le": min(high, most), "default": default, **other}
    return Field(**made)


class Envelope(Arguments):
    """Fields of every request."""

    id: int
    room: str
    order: str
    with_: dict[str, Any] = {}


class Wire(Protocol):
    """The WebSocket of a page."""

    async def send_text(self, data: str) -> None:
        """Send state."""
        ...

    async def send_bytes(self, data: bytes) -> None:
        """Send frames."""
        ...


@dataclass(slots=True, eq=False)
class Page:
    """An open page."""

    number: int
    """Counts from 1."""
    wire: Wire
    visible: bool = True
    """False for a hidden page, as the page itself reports."""
    last_alive: float = 0.0
    """Time of its last "alive" message, in s of the monotonic clock."""
    credit: int = 24
    """Number of frame messages that may still be sent before the page confirms some."""
    read_until: float = -math.inf
    """Time up to which the limit allows the messages that were read; it may be a second behind the present."""
    waiting: "asyncio.Queue[str | None]" = field(default_factory=lambda: asyncio.Queue[str | None](256))
    """Messages to send; None for the whole state, which then has all changes so far."""
    whole_waits: bool = False
    """True while the whole state is among them."""

    def pause(self, now: float, size: int) -> float:
        """Count a message that was read; returns the time in s to wait before the next one is read."""
        self.read_until = max(self.read_until, now - 1) + (1 + size // 4096) / MESSAGES_A_SECOND
        return max(0.0, self.read_until - now)


Handler = Callable[[Page, Any], Awaitable[Any] | Any]
"""Handles a request: takes the page and the checked arguments, and returns the answer."""


class StudioState:
    """State, pages and requests; `sounding` returns True while something plays."""

    def __init__(self, sounding: Callable[[], bool]) -> None:
        self.control = Control(sounding=sounding)
        self.pages: dict[int, Page] = {}
        self.state: dict[str, Any] = {}
        self._whole = ""
        self._number = 0
        self._pages = 0
        self._orders: dict[tuple[str, str], tuple[Handler, type[Arguments], bool]] = {}
        self.left: list[Callable[[Page], None]] = []
        self.alive: list[Callable[[Page], None]] = []
        self.missing: list[Callable[[], None]] = []

    def offer(
        self, room: str, order: str, act: Handler, model: type[Arguments] = Arguments, *, watchers: bool = False
    ) -> None:
        """Register the handler of a kind of request; a page without control may send it if `watchers`."""
        self._orders[room, order] = act, model, watchers

    def put(self, **sections: Any) -> None:
        """Change sections of the state and send the changes to all pages."""
        changed = {name: value for name, value in sections.items() if self.state.get(name) != value}
        if not changed:
            return
        self.state |= changed
        self._whole = ""
        self._number += 1
        text = json.dumps({"number": self._number, "set": changed})
        for page in list(self.pages.values()):
            if not page.whole_waits:
                self._queue(page, text)

    def enter(self, wire: Wire) -> Page:
        """Add a page and send it the whole state."""
        self._pages += 1
        page = Page(number=self._pages, wire=wire, last_alive=time.monotonic())
        self.pages[page.number] = page
        self.control.enter(page.number)
        self.whole(page)
        self.show_control()
        return page

    def leave(self, page: Page) -> None:
        """Remove a page."""
        self.pages.pop(page.number, None)
        self.control.leave(page.number)
        for callback in self.left:
            callback(page)
        self.show_control()

    def whole(self, page: Page) -> None:
        """Send the whole state to a page that is new or missed a change, unless it waits to be sent already."""
        if not page.whole_waits:
            page.whole_waits = True
            self._queue(page, None)

    async def next_text(self, page: Page) -> str:
        """Wait for the next message to a page, and return it."""
        if (text := await page.waiting.get()) is not None:
            return text
        page.whole_waits = False
        self._whole = self._whole or json.dumps(self.state)
        return f'{{"number": {self._number}, "page": {page.number}, "whole": {self._whole}}}'

    def show_control(self) -> None:
        """Send which page has control."""
        control = self.control
        self.put(control={"holder": control.holder, "asking": control.asking, "pages": sorted(self.pages)})

    async def on_message(self, page: Page, text: str) -> None:
        """Handle a message of a page."""
        try:
            said = json_of(text)
        except ValueError as wrong:
            self._queue(page, json.dumps({"id": 0, "error": f"request: expected JSON, got {wrong}"}))
            return
        if not isinstance(said, dict):
            return
        if "alive" in said:
            page.last_alive, page.visible = time.monotonic(), bool(said["alive"])
            for callback in self.alive:
                callback(page)
        elif "drew" in said:
            page.credit = min(24, page.credit + int(said["drew"])) if isinstance(said["drew"], int) else page.credit
        elif "whole" in said:
            self.whole(page)
        else:
            await self._order(page, said)

    async def _order(self, page: Page, said: dict[str, Any]) -> None:
        number = said.get("id") if isinstance(said.get("id"), int) else 0
        answer: dict[str, Any] = {"id": number}
        try:
            answer["ok"] = await self._act(page, said)
        except ValidationError as wrong:
            first = wrong.errors()[0]
            where, asked = ".".join(map(str, first["loc"])), first["msg"].replace("String", "Input")
            asked = asked.replace("Input should have", "expected").replace("Input should be", "expected")
            asked = asked if "pattern" not in first["type"] else f"expected {_PATTERNS.get(where, 'another text')}"
            answer["error"] = f"{where or 'request'}: {asked}, got {str(first['input'])[:60]!r}"
        except MidairError as wrong:
            answer["error"], answer["kind"] = str(wrong), type(wrong).__name__
            for callback in self.missing if isinstance(wrong, MissingFileError) else ():
                callback()  # the list of takes may name a file that another program removed
        except OSError as wrong:
            answer["error"] = f"{wrong.strerror or type(wrong).__name__}"
        except Exception as wrong:  # noqa: BLE001  # a page must not wait for an answer that does not come
            traceback.print_exc()
            answer["error"] = f"this is an error in midair, please report it: {type(wrong).__name__}: {wrong}"
        self._queue(page, json.dumps(answer))

    async def _act(self, page: Page, said: dict[str, Any]) -> Any:
        order = Envelope.model_validate({("with_" if key == "with" else key): value for key, value in said.items()})
        if (order.room, order.order) not in self._orders:
            raise InputError(f"request: expected one that this studio handles, got {order.room}.{order.order}")
        act, model, watchers = self._orders[order.room, order.order]
        arguments = model.model_validate(order.with_)
        if not watchers:
            self.control.check(page.number)
        done = act(page, arguments)
        return await done if isinstance(done, Awaitable) else done

    def _queue(self, page: Page, text: str | None) -> None:
        if page.waiting.full():
            # A page that reads nothing gets the whole state again once it reads.
            while not page.waiting.empty():
                page.waiting.get_nowait()
            page.whole_waits, text = True, None
        page.waiting.put_nowait(text)
