"""A panel of the studio: its tab, its script, and the requests that it handles."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from midair.studio.jobs import Jobs
from midair.studio.panels.play_panel import PlayPanel
from midair.studio.room_air import RoomAir
from midair.studio.studio_state import Arguments, Page, StudioState
from midair.studio.takes_list import TakesList

WEB = Path(__file__).parents[1] / "web"


@dataclass(slots=True, kw_only=True, eq=False)
class PanelContext:
    """Parts of the studio that panels use."""

    store: StudioState
    """State that all pages show, and their requests."""
    takes: TakesList
    """Takes of the folder; `takes.folder` is the folder."""
    jobs: Jobs
    """Long jobs, which the pages show."""
    reading: Jobs
    """Quick jobs, which read files."""
    playing: PlayPanel
    """The array."""
    air: RoomAir
    """The stated air of the room."""
    later: Callable[..., None]
    """Runs a function on the event loop, from any thread."""
    sensor: str
    """Name of the sensor."""
    array_calibration: Path | None
    """As in `StudioPlan`."""
    seed: int
    """Random seed of the virtual rig."""
    panels: dict[str, Any] = field(default_factory=dict[str, Any])
    """Panels by name."""

    def show_takes(self) -> None:
        """Send the list of takes."""
        self.store.put(takes=self.takes.rows())


class Panel:
    """A tab of the page; an instance lives as long as the studio and offers its requests when it is made.

    The default export of `script` is a class that builds the tab. The state of a panel is the section of its name.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    script: ClassVar[Path]
    place: ClassVar[float]
    """Place of the tab, from left to right."""

    def __init__(self, context: PanelContext) -> None:
        self._context, self._store, self._takes = context, context.store, context.takes
        self._state: dict[str, Any] = {}

    def start(self) -> None:
        """Act when the studio has started."""

    def left(self, page: Page) -> None:
        """Act when a page has gone."""

    def close(self) -> None:
        """Act when the studio ends."""

    def _offer(self, *, watchers: bool = False, **models: type[Arguments]) -> None:
        """Handle requests with these arguments by the methods of their names."""
        for order, model in models.items():
            self._store.offer(self.name, order, getattr(self, order), model, watchers=watchers)

    def _show(self, **changes: Any) -> None:
        self._state = {**self._state, **changes}
        self._store.put(**{self.name: self._state})
