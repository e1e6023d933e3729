"""Figures: Matplotlib figures of nouns, each with units on its axes. Nothing here writes a file."""

from midair.figures.budget import budget_figure
from midair.figures.card import card_figure
from midair.figures.errors import error_figure
from midair.figures.exposure import exposure_figure
from midair.figures.fields import maps_figure, phase_figure
from midair.figures.passes import passes_figure
from midair.figures.style import Style, png
from midair.figures.waveforms import beam_figure, spectra_figure, traces_figure

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
