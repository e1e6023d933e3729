"""Matplotlib figures and HTML pages with units on every axis; nothing here writes files."""

from midair.figures.calibration_sheet import calibration_figure
from midair.figures.card_maps import card_figure
from midair.figures.confusion_matrices import ConfusionPanel, confusion_figures
from midair.figures.correction_passes import passes_figure
from midair.figures.error_budget import budget_figure
from midair.figures.error_spread import ErrorSpread, trials_figure
from midair.figures.exposure import exposure_figure
from midair.figures.maps import maps_figure, phase_figure
from midair.figures.page import Picture, render_page
from midair.figures.palm_maps import PalmPanel, palm_figure
from midair.figures.paper_figures import FieldRow, fields_figure, objects_figure, stimuli_figure
from midair.figures.pattern_curves import Curve, Example, curve_figure, examples_figure, histogram_figure
from midair.figures.solve_errors import error_figure
from midair.figures.style import Style, new_figure, plain_axes, png_bytes
from midair.figures.traces import beam_figure, spectra_figure, traces_figure

__all__ = [
    "Curve",
    "ErrorSpread",
    "Example",
    "FieldRow",
    "ConfusionPanel",
    "Picture",
    "Style",
    "PalmPanel",
    "beam_figure",
    "budget_figure",
    "calibration_figure",
    "card_figure",
    "curve_figure",
    "error_figure",
    "examples_figure",
    "exposure_figure",
    "fields_figure",
    "histogram_figure",
    "maps_figure",
    "confusion_figures",
    "new_figure",
    "objects_figure",
    "palm_figure",
    "passes_figure",
    "phase_figure",
    "plain_axes",
    "png_bytes",
    "render_page",
    "spectra_figure",
    "stimuli_figure",
    "traces_figure",
    "trials_figure",
]
