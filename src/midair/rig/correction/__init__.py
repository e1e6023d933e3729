"""The correction loop (play, re-record, correct, compare), its report, and the error budget of each stage."""

from .budget_stages import BudgetPlan as BudgetPlan
from .budget_stages import band_power_share as band_power_share
from .budget_stages import error_budget as error_budget
from .correction_loop import Loop as Loop
from .correction_loop import loop as loop
from .drive_rerecording import DriveRerecording as DriveRerecording
from .drive_rerecording import PlayedPair as PlayedPair
from .drive_rerecording import aligned_pair as aligned_pair
from .drive_rerecording import original_of_drive as original_of_drive
from .drive_rerecording import palm_frames_of_drive as palm_frames_of_drive
from .drive_rerecording import palm_of_drive as palm_of_drive
from .drive_rerecording import palm_of_loop as palm_of_loop
from .drive_rerecording import played_chain as played_chain
from .drive_rerecording import rerecord_drive as rerecord_drive
from .loop_report import FIELD_TITLE as FIELD_TITLE
from .loop_report import loop_figures as loop_figures
from .loop_report import view_of_loop as view_of_loop
from .loop_report import write_report as write_report
from .outcomes import PALM_TITLE as PALM_TITLE
from .outcomes import Outcome as Outcome
from .outcomes import comparison_rows as comparison_rows
from .outcomes import metrics_of_loop as metrics_of_loop
from .outcomes import next_step as next_step
from .outcomes import summarise_outcomes as summarise_outcomes
from .passes import Stage as Stage
from .passes import no_progress as no_progress
