"""The panels of the studio: the requests that each handles and the state that it shows."""

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
