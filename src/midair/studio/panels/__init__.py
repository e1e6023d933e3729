"""The panels of the studio: the requests that each handles and the state that it shows."""

from .panel import PANELS as PANELS
from .panel import Panel as Panel
from .panel import PanelContext as PanelContext
from .play_panel import PlayPanel as PlayPanel
