"""Matplotlib figures and HTML pages with units on every axis; nothing here writes files."""

from .calibration_sheet import calibration_figure as calibration_figure
from .maps import beam_figure as beam_figure
from .maps import card_figure as card_figure
from .maps import exposure_figure as exposure_figure
from .maps import map_source as map_source
from .maps import maps_figure as maps_figure
from .maps import phase_figure as phase_figure
from .maps import spectra_figure as spectra_figure
from .maps import strongest_moment as strongest_moment
from .maps import traces_figure as traces_figure
from .paper_figures import FieldRow as FieldRow
from .paper_figures import budget_figure as budget_figure
from .paper_figures import curve_figure as curve_figure
from .paper_figures import error_figure as error_figure
from .paper_figures import fields_figure as fields_figure
from .paper_figures import histogram_figure as histogram_figure
from .paper_figures import passes_figure as passes_figure
from .paper_figures import stimuli_figure as stimuli_figure
from .paper_figures import trials_figure as trials_figure
from .style import STYLE as STYLE
from .style import Picture as Picture
from .style import label_axes as label_axes
from .style import new_figure as new_figure
from .style import plain_axes as plain_axes
from .style import png_bytes as png_bytes
from .style import render_page as render_page
