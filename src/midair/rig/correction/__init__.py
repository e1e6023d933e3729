"""The correction loop (play, re-record, correct, compare), its report, and the error budget of each stage."""

from midair.rig.correction.budget_stages import BudgetPlan, band_power_share, error_budget
from midair.rig.correction.correction_loop import Loop, run_loop
from midair.rig.correction.drive_rerecording import DriveRerecording, rerecord_drive
from midair.rig.correction.loop_pictures import FIELD_TITLE, loop_figures
from midair.rig.correction.loop_report import write_report
from midair.rig.correction.loop_view import view_of_loop
from midair.rig.correction.outcomes import PALM_TITLE, Outcome, comparison_rows, metrics_of_loop, summarise_outcomes
from midair.rig.correction.palm_simulation import palm_frames_of_drive, palm_of_drive, palm_of_loop, played_chain
from midair.rig.correction.passes import Stage, no_progress
from midair.rig.correction.played_pair import PlayedPair, aligned_pair, original_of_drive

__all__ = [
    "FIELD_TITLE",
    "PALM_TITLE",
    "BudgetPlan",
    "DriveRerecording",
    "Loop",
    "Outcome",
    "PlayedPair",
    "Stage",
    "original_of_drive",
    "aligned_pair",
    "metrics_of_loop",
    "error_budget",
    "rerecord_drive",
    "band_power_share",
    "palm_frames_of_drive",
    "palm_of_drive",
    "palm_of_loop",
    "played_chain",
    "loop_figures",
    "no_progress",
    "run_loop",
    "comparison_rows",
    "summarise_outcomes",
    "view_of_loop",
    "write_report",
]
