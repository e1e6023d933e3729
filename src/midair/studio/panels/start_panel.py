"""Panel Start: three ways to a first touch, and the newest takes."""

from midair.studio.panels.panel import WEB, Panel


class StartPanel(Panel):
    """The panel that a page shows first; it has no requests of its own."""

    name, title, script, place = "start", "Start", WEB / "room-start.js", 1
