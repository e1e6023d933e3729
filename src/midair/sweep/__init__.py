"""Sweeps: solve many patterns or recordings in parallel processes, one file per task in a folder, and report them."""

from .patterns import PatternSweep as PatternSweep
from .recordings import RecordingSweep as RecordingSweep
from .recordings import SweepTrial as SweepTrial
from .report import sweep_report as sweep_report
from .report import write_sweep_report as write_sweep_report
from .run import Sweep as Sweep
from .run import SweepResults as SweepResults
from .run import load_sweep as load_sweep
from .run import run_sweep as run_sweep
