"""Settings of calibration, target, compensation, solver and air, declared once, and the modes that name sets of them.

The options of the command line, the provenance of drives and the table of the documentation are derived from them.
"""

from midair.settings.choices import CHOICES, Choice, choices_table, format_setting, format_value, nearest_mode
from midair.settings.mode import (
    MODES,
    Mode,
    best_mode,
    finest_mode,
    paper_mode,
    quick_mode,
    with_fewer_points,
    with_paper_mode,
)
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
    "with_paper_mode",
    "best_mode",
    "choices_table",
    "with_fewer_points",
    "finest_mode",
    "nearest_mode",
    "paper_mode",
    "quick_mode",
    "format_value",
    "format_setting",
]
