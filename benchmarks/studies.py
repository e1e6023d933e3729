"""What limits cover and how often tests find nothing there, in simulated studies: `python -m benchmarks.studies`.

Coverage: the share of studies whose 95 % limits hold the true figure, and how many studies gave no limits. Errors: the
share of studies without an effect in which a test comes below .05, by trials a person. People differ in d', in their
favourite answers and in their thresholds, as stated in each line. The standard error of a share of .95 is .007 with
1000 studies and .011 with 400.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from benchmarks.clock import load
from midair.errors import InputError
from midair.study import (
    Confusion,
    Psychometric,
    chance_macro_f,
    choice_model,
    cohen_kappa,
    d_prime_choice,
    d_prime_yes_no,
    equivalence,
    f_measure,
    fit_psychometric,
    limits_over_people,
    logistic_mixed,
    ordinal_check,
    paired_t,
    proportion_correct,
    rm_anova,
    sign_flip,
    wilson,
)
from midair.study.statistics import fit_threshold

OBJECTS = 3
LEVELS = np.geomspace(0.25, 4, 8)
STATISTICS = {
    "share of right answers": (lambda c: float(np.trace(c) / c.sum()), "share"),
    "F of one object": (lambda c: float(f_measure(c)[0]), "share"),
    "macro F": (lambda c: float(f_measure(c).mean()), "share"),
    "d'": (lambda c: d_prime_choice(int(np.trace(c)), int(c.sum()), alternatives=OBJECTS).d_prime, "plain"),
    "kappa": (cohen_kappa, "correlation"),
}


def main() -> None:
    ask = argparse.ArgumentParser(prog="python -m benchmarks.studies", description=__doc__.splitlines()[0])
    ask.add_argument("--studies", type=int, default=1000, help="simulated studies a line (default 1000)")
    ask.add_argument("--part", choices=[*COVERAGE, "errors"], nargs="*", default=[*COVERAGE, "errors"])
    ask.add_argument("--trials", type=int, nargs="*", default=[48, 200, 400, 1000], help="of the tests, a person")
    ask.add_argument("--seed", type=int, default=2026, help="of all chance (default 2026)")
    said = ask.parse_args()
    print(load())
    print(f"coverage of 95 % limits, {said.studies} studies a line")
    for name in said.part:
        if name in COVERAGE:
            COVERAGE[name](said.studies, said.seed)
    if "errors" in said.part:
        print(f"share of p < .05 without an effect, {said.studies} studies, 10 people; trials a person:", *said.trials)
        for name, test in TESTS.items():
            shares = [errors(test, trials, said.studies, said.seed) for trials in said.trials]
            print(f"{name:45}", *(f"{share:.3f}" for share in shares), flush=True)
    print(load())


def answers(rng: np.random.Generator, people: int, trials: int, d: float, spread: float, favour: float) -> np.ndarray:
    """Counts of people who pick the largest of three internal values, shape (participant, presented, answered)."""
    own = rng.normal(d, spread, (people, 1))
    x = rng.normal(size=(people, OBJECTS, trials // OBJECTS, OBJECTS)) + rng.normal(0, favour, (people, 1, 1, OBJECTS))
    for thing in range(OBJECTS):
        x[:, thing, :, thing] += own
    return (x.argmax(axis=-1)[..., None] == np.arange(OBJECTS)).sum(axis=2)


def say(name: str, inside: list[bool | None]) -> None:
    """One line: None stands for a study without limits."""
    known = [one for one in inside if one is not None]
    print(f"{name:72} {np.mean(known) if known else np.nan:.3f}  without limits {len(inside) - len(known)}", flush=True)


def over_people(studies: int, seed: int) -> None:
    """Figures of choices, and the difference between two conditions."""
    for people, trials, d, spread, favour in (
        *((n, 12, 1.2, 0.5, 0.4) for n in (5, 6, 10, 20)),
        *((n, 48, 1.2, 0.5, 0.4) for n in (5, 10)),
        *((n, 12, d, 0.3, 0.4) for n in (5, 10) for d in (0.3, 2.5)),
    ):
        rng = np.random.default_rng([seed, people, trials, int(10 * d)])
        true = sum(answers(rng, 5000, 48, d, spread, favour).sum(axis=0) for _ in range(8))
        drawn = [answers(rng, people, trials, d, spread, favour) for _ in range(studies)]
        for name, (statistic, scale) in STATISTICS.items():
            found = [limits_over_people(lambda p, f=statistic: f(p.sum(axis=0)), one, scale=scale) for one in drawn]
            value = statistic(true)
            say(
                f"{name}: {people} people x {trials} trials, d' {d} (sd {spread}), favourites",
                [None if np.isnan(one.low) else bool(one.low <= value <= one.high) for one in found],
            )
        inside: list[bool | None] = []
        for _ in range(studies):
            first, second = (f_measure(answers(rng, people, trials, d, spread, favour)).mean(axis=-1) for _ in "ab")
            try:
                both = paired_t(first, second)
                inside.append(both.low <= 0 <= both.high)
            except InputError:
                inside.append(None)
        say(f"difference of macro F: {people} people x {trials} trials, d' {d}", inside)


def of_thresholds(studies: int, seed: int) -> None:
    """Thresholds of one function from trials, and of people who differ."""
    rng = np.random.default_rng(seed)
    for shape, guess, slope in (("weibull", 0.5, 2.0), ("weibull", 1 / 3, 3.0), ("logistic", 0.0, 3.0)):
        levels = LEVELS if shape == "weibull" else np.linspace(-0.5, 2.5, 8)
        true = Psychometric(threshold=1, slope=slope, guess=guess, lapse=0.02, shape=shape)
        for trials in (40, 80, 160, 400):
            inside: list[bool | None] = []
            for _ in range(studies):
                right = rng.binomial(trials // 8, true.probability(levels))
                try:
                    options = {"guess": guess, "shape": shape, "draws": 0}
                    found = fit_psychometric(levels, right, np.full(8, trials // 8), rng=rng, **options)
                    inside.append(found.threshold_low <= 1 <= found.threshold_high)
                except InputError:
                    inside.append(None)
            say(f"threshold from trials: {shape}, guess {guess:.2f}, {trials} trials", inside)
    for people, spread in ((5, 0.2), (5, 0.4), (10, 0.4), (20, 0.4)):
        many = _right(rng, 100_000, 20, spread).sum(axis=0)
        near = fit_psychometric(LEVELS, many[:, 0], many[:, 1], rng=rng, guess=0.5, shape="weibull", draws=0).function
        inside = []
        for _ in range(studies):
            found = limits_over_people(
                lambda p, near=near: fit_threshold(LEVELS, *p.sum(axis=0).T, guess=0.5, shape="weibull", near=near),
                _right(rng, people, 10, spread),
                scale="positive",
            )
            inside.append(bool(found.low <= near.threshold <= found.high))
        say(f"threshold over people: {people} people x 80 trials, sd of log {spread}", inside)
        found = [
            limits_over_people(_geometric, np.exp(rng.normal(0, spread, people)), scale="positive") for _ in inside
        ]
        say(f"geometric mean of {people} thresholds", [bool(one.low <= 1 <= one.high) for one in found])


def of_trials(studies: int, seed: int) -> None:
    """Limits that take trials as independent, of one observer."""
    rng = np.random.default_rng(seed)
    for total in (20, 40, 120):
        for d in (0.5, 1.2, 2.0):
            share = float(proportion_correct(d, alternatives=OBJECTS))
            right = rng.binomial(total, share, studies)
            low, high = wilson(right, np.full(studies, total))
            say(f"share (Wilson): {total} trials, {share:.2f}", ((low <= share) & (share <= high)).tolist())
            sense = [d_prime_choice(int(k), total, alternatives=OBJECTS) for k in right]
            say(f"d' of a choice: {total} trials, {d}", [bool(one.low <= d <= one.high) for one in sense])
            hits, alarms = (rng.binomial(total, _above(side * d / 2), studies) for side in (-1, 1))
            sense = [d_prime_yes_no(int(h), total, int(a), total) for h, a in zip(hits, alarms, strict=True)]
            say(f"d' of yes and no: {total} and {total} trials, {d}", [one.low <= d <= one.high for one in sense])


def of_ratings(studies: int, seed: int) -> None:
    """Means of ratings with people's levels taken out, for the people of the study."""
    from midair.study import data_of_columns
    from midair.study.findings.rating_findings import rating_means

    rng = np.random.default_rng(seed)
    for people in (5, 10, 20):
        inside: list[bool | None] = []
        for _ in range(studies // 6 + 1):
            level = rng.normal(4, 1, (people, 1, 1))
            y = level + rng.normal(0, 0.8, (people, 2, 3))
            who, surface, thing = np.indices(y.shape).reshape(3, -1)
            table = {"participant": who, "surface": surface, "object": thing, "score": y.ravel()}
            found = rating_means(
                data_of_columns(table, participant="participant", rating="score", within=["surface", "object"])
            )
            assert found is not None
            true = float(level.mean())
            inside += ((found["low"] <= true) & (true <= found["high"])).tolist()
        say(f"mean rating of these people: {people} people, 2 x 3 cells", inside)


def errors(test: Callable[[np.random.Generator, int], float], trials: int, studies: int, seed: int) -> float:
    """Share of studies in which a test comes below .05."""
    rng = np.random.default_rng([seed, trials])
    return float(np.mean([test(rng, trials) < 0.05 for _ in range(studies)]))


def _pair(rng: np.random.Generator, trials: int) -> list[np.ndarray]:
    return [f_measure(answers(rng, 10, trials, 1.0, 0.4, 0.4)).mean(axis=-1) for _ in "ab"]


def _macro(rng: np.random.Generator, trials: int) -> float:
    counts = answers(rng, 10, trials, 0.0, 0.0, 0.6)
    confusion = Confusion(by_person=counts, labels=tuple("abc"), participants=tuple(range(10)))
    return chance_macro_f(confusion, rng=rng, draws=199).p


def _mixed(rng: np.random.Generator, trials: int, differ: float, effect: int) -> float:
    each = trials // 6
    logit = 0.5 + rng.normal(0, 0.7, (10, 1, 1)) + rng.normal(0, differ, (10, 2, 1)) + rng.normal(0, differ, (10, 1, 3))
    logit = logit + rng.normal(0, differ, (10, 2, 3))
    correct = rng.random((10, 2, 3, each)) < 1 / (1 + np.exp(-logit))[..., None]
    who, surface, thing, _ = np.indices(correct.shape).reshape(4, -1)
    table = {"correct": correct.ravel().astype(float), "who": who, "surface": surface, "object": thing}
    return logistic_mixed(table, correct="correct", participant="who", within=["surface", "object"])["p"][effect]


def _ratings(rng: np.random.Generator, trials: int) -> dict[str, np.ndarray]:
    each = trials // 6
    shown = rng.normal(4, 0.8, (10, 1, 1)) + rng.normal(0, 0.5, (10, 2, 3))
    y = np.clip(np.rint(shown[..., None] + rng.normal(0, 1, (10, 2, 3, each))), 1, 7)
    who, surface, thing, _ = np.indices(y.shape).reshape(4, -1)
    return {"y": y.ravel(), "who": who, "surface": surface, "object": thing, "hand": who % 3 // 2}


def _anova(rng: np.random.Generator, trials: int, effect: str, between: tuple[str, ...] = ()) -> float:
    options = {"value": "y", "participant": "who", "within": ["surface", "object"], "between": between}
    return rm_anova(_ratings(rng, trials), **options).set_index("effect").loc[effect, "p_GG"]


def _ranks(rng: np.random.Generator, trials: int) -> float:
    options = {"value": "y", "participant": "who", "within": ["surface", "object"], "rng": rng}
    return ordinal_check(_ratings(rng, trials), **options).set_index("effect").loc["object", "p_sign"]


def _misfit(rng: np.random.Generator, trials: int) -> float:
    true = Psychometric(threshold=1, slope=2.0, guess=0.5, lapse=0.02, shape="weibull")
    each = np.full(8, max(trials // 8, 1))
    try:
        options = {"guess": 0.5, "shape": "weibull", "draws": 99}
        return fit_psychometric(
            LEVELS, rng.binomial(each, true.probability(LEVELS)), each, rng=rng, **options
        ).deviance_p
    except InputError:
        return 1.0


def _taste(rng: np.random.Generator, trials: int) -> float:
    share = np.array([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]]) * np.array([1.3, 1.0, 0.7])
    counts = np.array([rng.multinomial(trials // 3, row / row.sum()) for row in share])
    return choice_model(counts).p


COVERAGE: dict[str, Callable[[int, int], None]] = {
    "people": over_people,
    "trials": of_trials,
    "ratings": of_ratings,
    "thresholds": of_thresholds,
}
"""What limits are of."""

TESTS: dict[str, Callable[[np.random.Generator, int], float]] = {
    "macro F against shuffled answers": _macro,
    "paired t of macro F": lambda rng, trials: paired_t(*_pair(rng, trials)).p,
    "turned signs of macro F": lambda rng, trials: sign_flip(np.subtract(*_pair(rng, trials)), rng=rng),
    "equivalence, true difference at the margin": lambda rng, trials: (
        equivalence(_pair(rng, trials)[0] + 0.1, _pair(rng, trials)[1], margin=0.1).p
    ),
    "mixed model, main effect, people alike": lambda rng, trials: _mixed(rng, trials, 0.0, 1),
    "mixed model, main effect, people differ": lambda rng, trials: _mixed(rng, trials, 0.6, 1),
    "mixed model, interaction, people differ": lambda rng, trials: _mixed(rng, trials, 0.6, 2),
    "analysis of variance, GG, main effect": lambda rng, trials: _anova(rng, trials, "object"),
    "analysis of variance, GG, interaction": lambda rng, trials: _anova(rng, trials, "surface:object"),
    "analysis of variance, 7 and 3 people in groups": lambda rng, trials: _anova(rng, trials, "hand", ("hand",)),
    "the same, group x object": lambda rng, trials: _anova(rng, trials, "hand:object", ("hand",)),
    "ranks, turned signs": _ranks,
    "misfit of a psychometric function": _misfit,
    "misfit of Luce's choice model": _taste,
}
"""P-value of one study of ten people without an effect, by the number of trials a person."""


def _right(rng: np.random.Generator, people: int, each: int, spread: float) -> np.ndarray:
    """Right answers and all answers of people with thresholds of their own, shape (participant, level, 2)."""
    threshold = np.exp(rng.normal(0, spread, (people, 1)))
    p = 0.5 + 0.48 * (1 - np.exp(-((LEVELS / threshold) ** 2)))
    return np.stack([rng.binomial(each, p), np.full(p.shape, each)], axis=-1).astype(float)


def _geometric(values: np.ndarray) -> float:
    return float(np.exp(np.log(values).mean()))


def _above(edge: float) -> float:
    from scipy.stats import norm

    return float(norm.sf(edge))


if __name__ == "__main__":
    main()
