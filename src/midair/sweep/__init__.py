"""Sweeps: solve many patterns or recordings in parallel processes, store the results in Zarr, and report them."""

from midair.sweep.pattern_report import PatternReport, PatternResults, report_of, write_sweep_report
from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.recording_report import TrialReport, trial_report, write_trial_report
from midair.sweep.recording_sweep import RecordingSweep, SweepTrial
from midair.sweep.run import run_sweep
from midair.sweep.store import load_sweep
from midair.sweep.task import Sweep

__all__ = [
    "PatternReport",
    "PatternResults",
    "PatternSweep",
    "RecordingSweep",
    "Sweep",
    "SweepTrial",
    "TrialReport",
    "load_sweep",
    "report_of",
    "run_sweep",
    "trial_report",
    "write_sweep_report",
    "write_trial_report",
]
