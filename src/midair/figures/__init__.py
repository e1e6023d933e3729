"""Figures: Matplotlib figures of nouns, each with units on its axes. Nothing here writes a file."""

from midair.figures.card_maps import card_figure
from midair.figures.loudness import exposure_figure
from midair.figures.maps import maps_figure, phase_figure
from midair.figures.progress_by_pass import passes_figure
from midair.figures.solve_errors import error_figure
from midair.figures.style import Style, png
from midair.figures.traces import beam_figure, spectra_figure, traces_figure
from midair.figures.waterfall import budget_figure

__all__ = [
    "Style",
    "beam_figure",
    "budget_figure",
    "card_figure",
    "error_figure",
    "exposure_figure",
    "maps_figure",
    "passes_figure",
    "phase_figure",
    "png",
    "spectra_figure",
    "traces_figure",
]
