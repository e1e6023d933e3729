"""Sweeps: solve many patterns or recordings in parallel processes, store the results in Zarr, and report them."""

from .pattern_report import PatternReport as PatternReport
from .pattern_report import PatternResults as PatternResults
from .pattern_report import TrialReport as TrialReport
from .pattern_report import report_of as report_of
from .pattern_report import trial_report as trial_report
from .pattern_report import write_sweep_report as write_sweep_report
from .pattern_report import write_trial_report as write_trial_report
from .pattern_sweep import PatternSweep as PatternSweep
from .recording_sweep import RecordingSweep as RecordingSweep
from .recording_sweep import SweepTrial as SweepTrial
from .run import run_sweep as run_sweep
from .store import Sweep as Sweep
from .store import load_sweep as load_sweep
