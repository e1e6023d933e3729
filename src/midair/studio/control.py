"""Control of the studio: one page may change things, every page may press STOP."""

from collections.abc import Callable
from dataclasses import dataclass

from midair.errors import DeviceStateError


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
