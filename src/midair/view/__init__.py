"""The view: frames on canvases, the same in the studio, in notebooks and in pages that stand alone."""

from midair.view.colours import TABLES, colour_table
from midair.view.finer import Finer, finer, finer_grid
from midair.view.pages import WEB
from midair.view.wire import Kind, Section, counted, pack, phase_counts, unpack

__all__ = [
    "Finer",
    "Kind",
    "Section",
    "TABLES",
    "WEB",
    "colour_table",
    "counted",
    "finer",
    "finer_grid",
    "pack",
    "phase_counts",
    "unpack",
]
