"""The rooms of the studio, a file each: what a page can order there, and what it is told."""

from midair.studio.panels.calibrate_panel import CalibratePanel
from midair.studio.panels.compare_panel import ComparePanel
from midair.studio.panels.live_panel import LivePanel
from midair.studio.panels.play_panel import PlayPanel
from midair.studio.panels.record_panel import RecordPanel
from midair.studio.panels.reproduce_panel import ReproducePanel, SolveForm
from midair.studio.panels.study_panel import StudyPanel

__all__ = [
    "CalibratePanel",
    "ComparePanel",
    "SolveForm",
    "LivePanel",
    "PlayPanel",
    "RecordPanel",
    "ReproducePanel",
    "StudyPanel",
]
