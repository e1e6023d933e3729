"""Coverage of confidence limits in simulated studies: `python -m benchmarks.studies`.

Coverage: share of studies whose 95 % limits contain the true value, and number of studies without limits. People differ
in d', in their preferred answers and in their thresholds, as stated in each line. The standard error of a share of .95
is .007 with 1000 studies and .011 with 400.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from benchmarks.clock import load
from midair.errors import InputError
from midair.study import (
    d_prime_choice,
    d_prime_same_different,
    d_prime_yes_no,
    equivalence,
    f_measure,
    paired_t,
    proportion_correct,
    wilson,
)
from midair.study.statistics.confusion import Interval
from midair.study.statistics.detection import d_prime_limits, f_limits, macro_f_limits, share_limits, two_answers_limits

OBJECTS = 3
LEVELS = np.geomspace(0.25, 4, 8)
FIGURES: dict[str, Callable[[np.ndarray], Interval]] = {
    "share of right answers": share_limits,
    "F of one object": f_limits,
    "macro F": macro_f_limits,
    "d'": d_prime_limits,
}
"""Figures of choices with their confidence limits over people."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies", description=__doc__.splitlines()[0])
    parser.add_argument("--studies", type=int, default=1000, help="simulated studies per line (default 1000)")
    parser.add_argument("--part", choices=[*COVERAGE], nargs="*", default=[*COVERAGE])
    parser.add_argument("--seed", type=int, default=2026, help="random seed (default 2026)")
    options = parser.parse_args()
    print(load())
    print(f"coverage of 95 % limits, {options.studies} studies per line")
    for name in options.part:
        COVERAGE[name](options.studies, options.seed)
    print(load())


def answers(rng: np.random.Generator, people: int, trials: int, d: float, spread: float, favour: float) -> np.ndarray:
    """Counts of people who choose the largest of three internal values, shape (participant, presented, answered)."""
    own = rng.normal(d, spread, (people, 1))
    x = rng.normal(size=(people, OBJECTS, trials // OBJECTS, OBJECTS)) + rng.normal(0, favour, (people, 1, 1, OBJECTS))
    for thing in range(OBJECTS):
        x[:, thing, :, thing] += own
    return (x.argmax(axis=-1)[..., None] == np.arange(OBJECTS)).sum(axis=2)


def holds(low: float, value: float, high: float) -> bool | None:
    """True if limits contain a value; None without limits."""
    return None if np.isnan(low) else bool(low <= value <= high)


def say(name: str, inside: list[bool | None]) -> None:
    """Print one line; None stands for a study without limits."""
    known = [one for one in inside if one is not None]
    print(f"{name:80} {np.mean(known) if known else np.nan:.3f}  without limits {len(inside) - len(known)}", flush=True)


def over_people(studies: int, seed: int) -> None:
    """Figures of choices, the difference between two conditions, and d' of questions with two answers."""
    for people, trials, d, spread, favour in (
        *((n, 12, 1.2, 0.5, 0.4) for n in (5, 6, 10, 20)),
        *((n, 48, 1.2, 0.5, 0.4) for n in (5, 10)),
        *((n, 12, d, 0.3, 0.4) for n in (5, 10) for d in (0.3, 2.0, 2.5, 3.0)),
        *((n, 48, d, 0.3, 0.4) for n in (5, 10) for d in (2.5, 3.0)),
    ):
        rng = np.random.default_rng([seed, people, trials, int(10 * d)])
        true = sum(answers(rng, 5000, 48, d, spread, favour).sum(axis=0) for _ in range(8))
        drawn = [answers(rng, people, trials, d, spread, favour) for _ in range(studies)]
        who = f"{people} people x {trials} trials, d' {d} (sd {spread})"
        for name, limits in FIGURES.items():
            # With this many people, the figure itself is the true value.
            value = np.atleast_1d(limits(np.stack([true] * 5)).value)[0]
            found = [limits(one) for one in drawn]
            say(
                f"{name}: {who}", [holds(np.atleast_1d(one.low)[0], value, np.atleast_1d(one.high)[0]) for one in found]
            )
        of_pairs(studies, who, lambda rng=rng, a=(people, trials, d, spread, favour): answers(rng, *a))
    for people, trials, d in ((n, k, d) for n in (5, 10, 20) for k in (12, 48) for d in (0.5, 1.2, 2.5)):
        of_two_answers(np.random.default_rng([seed, people, trials, int(10 * d)]), studies, people, trials, d)


def of_pairs(studies: int, who: str, draw: Callable[[], np.ndarray]) -> None:
    """Macro F of two conditions without a difference."""
    found: dict[str, list[bool | None]] = {"95 %": [], "90 %": []}
    for _ in range(studies):
        first, second = (f_measure(draw()).mean(axis=-1) for _ in "ab")
        try:
            both, same = paired_t(first, second), equivalence(first, second, margin=0.1)
        except InputError:
            found["95 %"].append(None)
            found["90 %"].append(None)
            continue
        found["95 %"].append(both.low <= 0 <= both.high)
        found["90 %"].append(same.low <= 0 <= same.high)
    say(f"difference of macro F: {who}", found["95 %"])
    say(f"the same, 90 % limits of the equivalence: {who}", found["90 %"])


def of_two_answers(rng: np.random.Generator, studies: int, people: int, trials: int, d: float) -> None:
    """d' of yes/no and same/different questions, for people who differ in d' and criterion."""
    for name, measure, chances in (
        ("yes and no", d_prime_yes_no, _yes),
        ("same and different", d_prime_same_different, _different),
    ):
        many = np.array(chances(rng.normal(d, 0.3, 10**6), rng.normal(0, 0.3, 10**6))).mean(axis=1)
        true = measure(*np.rint([many[0] * 1e9, 1e9, many[1] * 1e9, 1e9]).astype(int).tolist()).d_prime
        inside: list[bool | None] = []
        for _ in range(studies):
            rates = chances(rng.normal(d, 0.3, people), rng.normal(0, 0.3, people))
            hits, alarms = (rng.binomial(trials, rate) for rate in rates)
            table = np.stack([hits, np.full(people, trials), alarms, np.full(people, trials)], axis=1)
            try:
                found = two_answers_limits(measure, table)
            except InputError:
                inside.append(None)
                continue
            inside.append(holds(float(found.low), true, float(found.high)))
        say(f"d' of {name} over people: {people} people x {trials} and {trials} trials, {d}", inside)


def of_trials(studies: int, seed: int) -> None:
    """Confidence limits for independent trials of one observer."""
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
    """Mean ratings with the levels of people removed, for the people of the study."""
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


COVERAGE: dict[str, Callable[[int, int], None]] = {
    "people": over_people,
    "trials": of_trials,
    "ratings": of_ratings,
}
"""Coverage studies by name."""


def _above(edge: float) -> float:
    from scipy.stats import norm

    return float(norm.sf(edge))


def _yes(d: np.ndarray, criterion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities of "yes" with and without a stimulus."""
    from scipy.stats import norm

    return norm.sf(criterion - d / 2), norm.sf(criterion + d / 2)


def _different(d: np.ndarray, criterion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities of "different" for different and equal pairs: the difference of two values is large."""
    from scipy.stats import norm

    # A criterion cannot be below a difference of 0.
    k = np.maximum(1.5 + criterion, 0.0)
    return norm.sf((k - d) / 2**0.5) + norm.cdf((-k - d) / 2**0.5), 2 * norm.sf(k / 2**0.5)


if __name__ == "__main__":
    main()
