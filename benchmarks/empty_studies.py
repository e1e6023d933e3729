"""Simulated studies without an effect, to count false positives by trials per person (`python -m benchmarks.studies`).

Each study has ten people. Tests of the same answers share their simulated studies.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from midair.errors import InputError
from midair.study import (
    Confusion,
    Psychometric,
    chance_macro_f,
    choice_model,
    equivalence,
    f_measure,
    fit_psychometric,
    ordinal_check,
    paired_t,
    rm_anova,
    sign_flip,
)

OBJECTS = 3
LEVELS = np.geomspace(0.25, 4, 8)
PEOPLE = 10
Test = Callable[[np.random.Generator, int], tuple[float, ...]]
"""Function of a random generator and a number of trials that returns the p-values of one study."""


def errors(test: Test, trials: int, studies: int, seed: int) -> np.ndarray:
    """Share of studies in which each p-value is below .05, among those with a p-value."""
    rng = np.random.default_rng([seed, trials])
    p = np.array([test(rng, trials) for _ in range(studies)])
    return (p < 0.05).sum(axis=0) / np.isfinite(p).sum(axis=0)


def answers(rng: np.random.Generator, people: int, trials: int, d: float, spread: float, favour: float) -> np.ndarray:
    """Counts of people who choose the largest of three internal values, shape (participant, presented, answered)."""
    own = rng.normal(d, spread, (people, 1))
    x = rng.normal(size=(people, OBJECTS, trials // OBJECTS, OBJECTS)) + rng.normal(0, favour, (people, 1, 1, OBJECTS))
    for thing in range(OBJECTS):
        x[:, thing, :, thing] += own
    return (x.argmax(axis=-1)[..., None] == np.arange(OBJECTS)).sum(axis=2)


def _guessed(rng: np.random.Generator, trials: int) -> tuple[float]:
    """People with preferred answers who feel nothing."""
    counts = answers(rng, PEOPLE, trials, 0.0, 0.0, 0.6)
    confusion = Confusion(by_person=counts, labels=tuple("abc"), participants=tuple(range(PEOPLE)))
    return (chance_macro_f(confusion, rng=rng, draws=199).p,)


def _two_conditions(rng: np.random.Generator, trials: int) -> tuple[float, float, float]:
    """The same d' in both conditions; for the equivalence test, a true difference at the margin."""
    first, second = (f_measure(answers(rng, PEOPLE, trials, 1.0, 0.4, 0.4)).mean(axis=-1) for _ in "ab")
    same = equivalence(first + 0.1, second, margin=0.1)
    return paired_t(first, second).p, sign_flip(first - second, rng=rng), same.p


def _rated(rng: np.random.Generator, trials: int) -> tuple[float, ...]:
    """Ratings on a scale of seven steps."""
    each = trials // 6
    shown = rng.normal(4, 0.8, (PEOPLE, 1, 1)) + rng.normal(0, 0.5, (PEOPLE, 2, 3))
    y = np.clip(np.rint(shown[..., None] + rng.normal(0, 1, (PEOPLE, 2, 3, each))), 1, 7)
    who, surface, thing, _ = np.indices(y.shape).reshape(4, -1)
    table = {"y": y.ravel(), "who": who, "surface": surface, "object": thing, "hand": who % 3 // 2}
    options = {"value": "y", "participant": "who", "within": ["surface", "object"]}
    plain = rm_anova(table, **options).set_index("effect")["p_GG"]
    groups = rm_anova(table, between=["hand"], **options).set_index("effect")["p_GG"]
    ranks = ordinal_check(table, rng=rng, **options).set_index("effect")["p_sign"]
    return (
        *plain[["object", "surface:object"]],
        *groups[["hand", "hand:object"]],
        *ranks[["object", "surface:object"]],
    )


def _of_a_function(rng: np.random.Generator, trials: int) -> tuple[float]:
    """Answers from a Weibull function; NaN if they do not increase."""
    true = Psychometric(threshold=1, slope=2.0, guess=0.5, lapse=0.02, shape="weibull")
    each = np.full(8, trials // 8)
    right = rng.binomial(each, true.probability(LEVELS))
    try:
        options = {"guess": 0.5, "shape": "weibull", "draws": 99, "limit_draws": 0}
        return (fit_psychometric(LEVELS, right, each, rng=rng, **options).deviance_p,)
    except InputError:
        return (np.nan,)


def _tastes(rng: np.random.Generator, trials: int) -> tuple[float]:
    """Confusions according to Luce's model, pooled over all people."""
    share = np.array([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]]) * np.array([1.3, 1.0, 0.7])
    counts = np.array([rng.multinomial(trials // 3, row / row.sum()) for row in share])
    return (choice_model(counts).p,)


TESTS: dict[tuple[str, ...], Test] = {
    ("macro F against shuffled answers",): _guessed,
    (
        "paired t of macro F",
        "turned signs of macro F",
        "equivalence, true difference at the margin",
    ): _two_conditions,
    (
        "analysis of variance, GG: three levels",
        "analysis of variance, GG: interaction",
        "analysis of variance, groups of 7 and 3 people",
        "analysis of variance, group x object",
        "ranks, turned signs: three levels",
        "ranks, turned signs: interaction",
    ): _rated,
    ("misfit of a psychometric function",): _of_a_function,
    ("misfit of Luce's choice model",): _tastes,
}
"""P-values of one study by name."""
