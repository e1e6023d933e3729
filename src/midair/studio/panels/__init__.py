"""The panels of the studio: the requests that each handles and the state that it shows."""

from .calibrate_panel import CalibratePanel as CalibratePanel
from .compare_panel import ComparePanel as ComparePanel
from .live_panel import LivePanel as LivePanel
from .play_panel import PlayPanel as PlayPanel
from .record_panel import RecordPanel as RecordPanel
from .reproduce_panel import ReproducePanel as ReproducePanel
from .reproduce_panel import SolveForm as SolveForm
from .study_panel import StudyPanel as StudyPanel
