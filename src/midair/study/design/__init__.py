"""Design of a study: stimuli, questions, blocks, trial orders, the plan and adaptive blocks."""

from midair.study.design.adaptive import QuestPlus, Staircase
from midair.study.design.adaptive_block import next_stimulus, thresholds_of
from midair.study.design.adaptive_levels import stimulus_levels
from midair.study.design.analysis_plan import (
    Analysis,
    Exclusions,
    Incomplete,
    PlannedPower,
    PowerTest,
    UnpresentedAnswers,
)
from midair.study.design.answers import answers_table
from midair.study.design.blocks import Block, Criterion, Extra
from midair.study.design.exclusions import excluded_participants
from midair.study.design.order import balanced_latin_square, constrained_shuffle
from midair.study.design.plan import Plan, Trial, block_order, digest_of, draw_plan
from midair.study.design.question import Question
from midair.study.design.session_state import Policy, SessionState, replay, right_answer_of_trial
from midair.study.design.stimulus import Stimulus, right_answer
from midair.study.design.study_design import Design, MaskingNoise

__all__ = [
    "Analysis",
    "Block",
    "Criterion",
    "Design",
    "Exclusions",
    "UnpresentedAnswers",
    "Incomplete",
    "Extra",
    "MaskingNoise",
    "Plan",
    "PlannedPower",
    "PowerTest",
    "Policy",
    "QuestPlus",
    "Question",
    "Staircase",
    "SessionState",
    "Stimulus",
    "Trial",
    "answers_table",
    "balanced_latin_square",
    "block_order",
    "constrained_shuffle",
    "digest_of",
    "draw_plan",
    "excluded_participants",
    "next_stimulus",
    "replay",
    "right_answer",
    "right_answer_of_trial",
    "stimulus_levels",
    "thresholds_of",
]
