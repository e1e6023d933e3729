"""Settings of calibration, target, compensation, solver and air, declared once, and the modes that name sets of them.

The options of the command line, the provenance of drives and the table of the documentation are derived from them.
"""

from midair.settings.choices import CHOICES, Choice, choices_table, over_mode, spelt, spelt_setting
from midair.settings.mode import MODES, Mode, beside_paper, best_mode, coarser, finest_mode, paper_mode, quick_mode
from midair.settings.settings import (
    CalibrationSettings,
    CompensationSettings,
    Settings,
    SolverSettings,
    TargetSettings,
)

__all__ = [
    "CHOICES",
    "MODES",
    "CalibrationSettings",
    "Choice",
    "CompensationSettings",
    "Mode",
    "Settings",
    "SolverSettings",
    "TargetSettings",
    "beside_paper",
    "best_mode",
    "choices_table",
    "coarser",
    "finest_mode",
    "over_mode",
    "paper_mode",
    "quick_mode",
    "spelt",
    "spelt_setting",
]
