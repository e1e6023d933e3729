"""The panels of the studio: the requests that each handles and the state that it shows.

A panel is a module of this folder with a class of `Panel`, and its script.
"""

from importlib import import_module
from pkgutil import iter_modules

from .panel import Panel as Panel
from .panel import PanelContext as PanelContext
from .play_panel import PlayPanel as PlayPanel

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")

PANELS: dict[str, type[Panel]] = {
    each.name: each for each in sorted(Panel.__subclasses__(), key=lambda panel: panel.place)
}
"""Tabs of the page from left to right."""
