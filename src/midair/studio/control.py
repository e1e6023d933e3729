"""One controller: of all pages that look at a studio, one may change things; every one may stop."""

from collections.abc import Callable
from dataclasses import dataclass

from midair.errors import DeviceStateError


@dataclass(slots=True, kw_only=True)
class Control:
    """Which page has control, and which one asks for it.

    Attributes
    ----------
    sounding : callable
        Whether something sounds now: control then changes hands by consent only.
    holder, asking : int
        Numbers of pages; 0 for none.
    """

    sounding: Callable[[], bool]
    holder: int = 0
    asking: int = 0

    def enter(self, page: int) -> None:
        """A page came: the first one has control."""
        if not self.holder:
            self.holder = page

    def leave(self, page: int) -> bool:
        """A page went; whether it had control, which nobody has then until somebody takes it."""
        if self.asking == page:
            self.asking = 0
        if self.holder != page:
            return False
        self.holder = 0
        return True

    def check(self, page: int) -> None:
        """Raise DeviceStateError unless a page has control."""
        if self.holder != page:
            who = "another page has control" if self.holder else "nobody has control"
            raise DeviceStateError(f"this page only looks on: {who}; take control first")

    def take(self, page: int) -> bool:
        """A page wants control; whether it has it now. While something sounds, the holder is asked."""
        if self.holder == page:
            return True
        if self.holder and self.sounding():
            self.asking = page
            return False
        self.holder, self.asking = page, 0
        return True

    def give(self, page: int, *, to: int) -> None:
        """The holder consents.

        Raises
        ------
        DeviceStateError
            If this page has no control to give, or that one does not ask for it any more.
        """
        self.check(page)
        if to != self.asking or not to:
            raise DeviceStateError("control: expected a page that asks for it, got none")
        self.holder, self.asking = to, 0

    def refuse(self, page: int) -> None:
        """The holder keeps it."""
        self.check(page)
        self.asking = 0
