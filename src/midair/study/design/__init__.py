"""Design: stimuli, questions, blocks, orders, the plan, and blocks that follow the answers."""

from midair.study.design.adaptive import QuestPlus, Staircase
from midair.study.design.adaptive_block import next_stimulus, thresholds_of
from midair.study.design.blocks import Analysis, Block, Design, Stimulus, right_answer
from midair.study.design.order import balanced_latin_square, constrained_shuffle
from midair.study.design.plan import Plan, Trial, block_order, digest_of, draw_plan
from midair.study.design.question import Question
from midair.study.design.standing import Policy, Standing, answers_table, replay

__all__ = [
    "Analysis",
    "Block",
    "Design",
    "Plan",
    "Policy",
    "QuestPlus",
    "Question",
    "Staircase",
    "Standing",
    "Stimulus",
    "Trial",
    "answers_table",
    "balanced_latin_square",
    "block_order",
    "constrained_shuffle",
    "digest_of",
    "draw_plan",
    "next_stimulus",
    "replay",
    "right_answer",
    "thresholds_of",
]
