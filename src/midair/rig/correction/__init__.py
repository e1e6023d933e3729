"""The correction loop (play, re-record, correct, compare), its report, and the error budget of each stage."""

from midair.rig.correction.budget_stages import BudgetPlan, error_budget, kept_in_band
from midair.rig.correction.correction_loop import Loop, run_loop
from midair.rig.correction.drive_rerecording import DriveRerecording, rerecord_drive
from midair.rig.correction.loop_pictures import pictures
from midair.rig.correction.loop_report import write_report
from midair.rig.correction.loop_view import view_of_loop
from midair.rig.correction.outcomes import Outcome, metrics_of_loop, side_by_side, verdict
from midair.rig.correction.palm_simulation import palm_frames_of_drive, palm_of_drive, palm_of_loop, played_chain
from midair.rig.correction.passes import Stage, quiet
from midair.rig.correction.played_pair import PlayedPair, aligned_pair, asked_of

__all__ = [
    "BudgetPlan",
    "DriveRerecording",
    "Loop",
    "Outcome",
    "PlayedPair",
    "Stage",
    "asked_of",
    "aligned_pair",
    "metrics_of_loop",
    "error_budget",
    "rerecord_drive",
    "kept_in_band",
    "palm_frames_of_drive",
    "palm_of_drive",
    "palm_of_loop",
    "played_chain",
    "pictures",
    "quiet",
    "run_loop",
    "side_by_side",
    "verdict",
    "view_of_loop",
    "write_report",
]
