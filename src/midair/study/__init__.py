"""Studies: design, simulated participants, and statistics. Pure: knows no file, clock, sound or device."""

from midair.study.design.adaptive import QuestPlus, Staircase
from midair.study.design.blocks import Analysis, Block, Design, Stimulus
from midair.study.design.order import balanced_latin_square, constrained_shuffle
from midair.study.design.plan import Plan, Trial, draw_plan
from midair.study.design.question import Question
from midair.study.design.standing import Progress, answers_table, replay
from midair.study.findings.analysis import Report, analyse
from midair.study.findings.study_data import StudyData, data_of_answers, data_of_columns
from midair.study.session.participant import SimulatedParticipant
from midair.study.statistics.anova import rm_anova
from midair.study.statistics.confusion import (
    Confusion,
    chance_macro_f,
    confusion_matrix,
    f_measure,
    mutual_information,
    scores,
    wilson,
)
from midair.study.statistics.detection import (
    ChoiceModel,
    Sensitivity,
    choice_model,
    d_prime_choice,
    d_prime_same_different,
    d_prime_yes_no,
    proportion_correct,
)
from midair.study.statistics.mixed import logistic_mixed, logistic_posterior
from midair.study.statistics.ordinal import ordinal_check
from midair.study.statistics.paired import Equivalence, PairedT, bayes_factor, equivalence, holm, paired_t
from midair.study.statistics.power import (
    IdentificationExperiment,
    Power,
    RatingExperiment,
    participants_for_paired_t,
    power_curve,
    power_paired_t,
    simulated_power,
)
from midair.study.statistics.psychometric import Psychometric, PsychometricFit, fit_psychometric
from midair.study.statistics.resample import Chance, Interval, bootstrap, sign_flip
from midair.study.statistics.table import Table

__all__ = [
    "Analysis",
    "Block",
    "Chance",
    "ChoiceModel",
    "Confusion",
    "Design",
    "Equivalence",
    "IdentificationExperiment",
    "Interval",
    "PairedT",
    "Plan",
    "Power",
    "Progress",
    "Psychometric",
    "PsychometricFit",
    "QuestPlus",
    "Question",
    "RatingExperiment",
    "Report",
    "Sensitivity",
    "SimulatedParticipant",
    "Staircase",
    "Stimulus",
    "StudyData",
    "Table",
    "Trial",
    "analyse",
    "answers_table",
    "balanced_latin_square",
    "bayes_factor",
    "bootstrap",
    "chance_macro_f",
    "choice_model",
    "confusion_matrix",
    "constrained_shuffle",
    "d_prime_choice",
    "d_prime_same_different",
    "d_prime_yes_no",
    "data_of_answers",
    "data_of_columns",
    "draw_plan",
    "equivalence",
    "f_measure",
    "fit_psychometric",
    "holm",
    "logistic_mixed",
    "logistic_posterior",
    "mutual_information",
    "ordinal_check",
    "paired_t",
    "participants_for_paired_t",
    "power_curve",
    "power_paired_t",
    "proportion_correct",
    "replay",
    "rm_anova",
    "scores",
    "sign_flip",
    "simulated_power",
    "wilson",
]
