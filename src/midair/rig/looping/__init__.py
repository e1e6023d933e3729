"""The loop: play, re-record, correct, play again, compare; its report, and where each loss comes from."""

from midair.rig.looping.budget_stages import BudgetPlan, error_budget, kept_in_band
from midair.rig.looping.correction_loop import Loop, run_loop
from midair.rig.looping.drive_heard import DriveHeard, hear_drive
from midair.rig.looping.loop_pictures import pictures
from midair.rig.looping.loop_report import write_report
from midair.rig.looping.loop_view import watched
from midair.rig.looping.outcomes import Outcome, card_of_loop, side_by_side, verdict
from midair.rig.looping.palm_simulation import palm_frames_of_drive, palm_of_drive, palm_of_loop, played_chain
from midair.rig.looping.passes import Stage, quiet
from midair.rig.looping.played_pair import PlayedPair, asked_of, brought_together

__all__ = [
    "BudgetPlan",
    "DriveHeard",
    "Loop",
    "Outcome",
    "PlayedPair",
    "Stage",
    "asked_of",
    "brought_together",
    "card_of_loop",
    "error_budget",
    "hear_drive",
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
    "watched",
    "write_report",
]
