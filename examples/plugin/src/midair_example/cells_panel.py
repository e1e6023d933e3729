"""A panel of the studio that shows which cell has the highest level now."""

from pathlib import Path

from midair.studio import Panel, PanelContext


class CellsPanel(Panel):
    """One request, which returns the number of the loudest cell."""

    name, title, script = "cells", "Loudest cell", Path(__file__).with_name("cells_panel.js")

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        context.store.offer("cells", "loudest", self.loudest, watchers=True)

    def loudest(self, *_: object) -> int | None:
        """Return the number of the loudest cell; None without a sensor."""
        levels = self._store.state["levels"]
        return None if levels is None else max(range(len(levels["rms"])), key=levels["rms"].__getitem__)
