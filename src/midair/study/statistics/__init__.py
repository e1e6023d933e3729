"""Statistics of choices, ratings and thresholds as pure functions of arrays and tables."""

from midair.study.statistics.anova import rm_anova
from midair.study.statistics.cell_averages import cell_means
from midair.study.statistics.choice_limits import (
    d_prime_limits,
    f_limits,
    kappa_limits,
    macro_f_limits,
    share_limits,
    two_answers_limits,
)
from midair.study.statistics.columns import column, frame_of, levels
from midair.study.statistics.confusion import (
    Confusion,
    chance_macro_f,
    cohen_kappa,
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
    EquivalenceExperiment,
    Experiment,
    IdentificationExperiment,
    Power,
    RatingExperiment,
    participants_for_paired_t,
    power_curve,
    power_paired_t,
    simulated_power,
)
from midair.study.statistics.psychometric import CurveShape, Psychometric, sigmoid
from midair.study.statistics.psychometric_fit import PsychometricFit, fit_psychometric, fit_threshold
from midair.study.statistics.published import chance_of_published, published_statistics
from midair.study.statistics.resample import Chance, Interval, Scale, limits_over_people, sign_flip

__all__ = [
    "Chance",
    "ChoiceModel",
    "Confusion",
    "CurveShape",
    "Equivalence",
    "EquivalenceExperiment",
    "Experiment",
    "IdentificationExperiment",
    "Interval",
    "PairedT",
    "Power",
    "Psychometric",
    "PsychometricFit",
    "RatingExperiment",
    "Scale",
    "Sensitivity",
    "bayes_factor",
    "cell_means",
    "chance_macro_f",
    "chance_of_published",
    "choice_model",
    "cohen_kappa",
    "column",
    "confusion_matrix",
    "d_prime_choice",
    "d_prime_limits",
    "d_prime_same_different",
    "d_prime_yes_no",
    "published_statistics",
    "equivalence",
    "f_limits",
    "f_measure",
    "fit_psychometric",
    "fit_threshold",
    "frame_of",
    "holm",
    "kappa_limits",
    "levels",
    "limits_over_people",
    "logistic_mixed",
    "logistic_posterior",
    "macro_f_limits",
    "mutual_information",
    "ordinal_check",
    "paired_t",
    "participants_for_paired_t",
    "power_curve",
    "power_paired_t",
    "proportion_correct",
    "rm_anova",
    "scores",
    "share_limits",
    "sign_flip",
    "simulated_power",
    "sigmoid",
    "two_answers_limits",
    "wilson",
]
