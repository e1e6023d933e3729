"""Panel Gallery: touches to start from, with picture, film and sound."""

from base64 import b64encode
from functools import cache
from typing import Any

from pydantic import Field

from midair.datasets import PICTURES, TOUCHES
from midair.evaluate import too_loud
from midair.studio.importing import film_of
from midair.studio.jobs import NEVER, Progressed
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.studio_state import Arguments, Page


class TouchNamed(Arguments):
    """Name of a touch."""

    touch: str = Field(pattern=f"^({'|'.join(TOUCHES)})$")


class GalleryPanel(Panel):
    """The gallery; a chosen touch becomes a file of the folder."""

    name, title, script, place = "gallery", "Gallery", WEB / "room-gallery.js", 9

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self._offer(view=TouchNamed, watchers=True)
        self._offer(take=TouchNamed)
        self._show(touches=[{"name": name, **one.facts, "loud": too_loud(one.ears)} for name, one in TOUCHES.items()])

    async def view(self, _: Page, order: TouchNamed) -> dict[str, Any]:
        """Return pictures as bytes in base64, their highest pressure, and a WAV file."""
        return await self._context.reading.result(f"view of {order.touch}", view_of, order.touch, after=NEVER)

    def take(self, _: Page, order: TouchNamed) -> dict[str, str]:
        """Write a touch into the folder; returns the file and the panel that opens it."""
        touch = TOUCHES[order.touch]
        path = self._takes.folder.free(touch.name, touch.ending)
        touch.write(path)
        self._context.show_takes()
        return {"file": path.name, "room": "reproduce" if touch.pattern is None else "draw"}


def view_of(name: str, _: Progressed) -> dict[str, Any]:
    """Compute the view of a touch in a worker process, which keeps it."""
    return _viewed(name)


@cache
def _viewed(name: str) -> dict[str, Any]:
    view = TOUCHES[name].view()
    return {
        "film": film_of(view.pictures, view.pitch, len(view.pictures) / PICTURES),
        "top_pa": float(f"{view.pictures.max():.3g}"),
        "simulated": view.simulated,
        "sound": b64encode(view.sound).decode(),
    }
