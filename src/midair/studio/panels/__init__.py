"""The panels of the studio: the requests that each handles and the state that it shows."""

from .calibrate_panel import CalibratePanel
from .compare_panel import ComparePanel
from .draw_panel import DrawPanel
from .gallery_panel import GalleryPanel
from .live_panel import LivePanel
from .panel import Panel as Panel
from .panel import PanelContext as PanelContext
from .play_panel import PlayPanel as PlayPanel
from .record_panel import RecordPanel
from .reproduce_panel import ReproducePanel
from .start_panel import StartPanel
from .study_panel import StudyPanel

PANELS: dict[str, type[Panel]] = {
    each.name: each
    for each in (
        StartPanel,
        RecordPanel,
        CalibratePanel,
        ReproducePanel,
        ComparePanel,
        DrawPanel,
        StudyPanel,
        LivePanel,
        GalleryPanel,
    )
}
"""Tabs of the page from left to right."""
