"""Coverage of confidence limits in simulated studies: `python -m benchmarks.studies`.

Coverage: share of studies whose 95 % limits contain the true value, and number of studies without limits. People differ
in d' and in their preferred answers, as stated in each line. The standard error of a share of .95 is .007 with 1000
studies and .011 with 400.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from benchmarks.clock import load
from midair.errors import InputError
from midair.study import equivalence, f_measure, paired_t

OBJECTS = 3


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


def say(name: str, inside: list[bool | None]) -> None:
    """Print one line; None stands for a study without limits."""
    known = [one for one in inside if one is not None]
    print(f"{name:80} {np.mean(known) if known else np.nan:.3f}  without limits {len(inside) - len(known)}", flush=True)


def over_people(studies: int, seed: int) -> None:
    """The difference of macro F between two conditions."""
    for people, trials, d, spread, favour in (
        *((n, 12, 1.2, 0.5, 0.4) for n in (5, 6, 10, 20)),
        *((n, 48, 1.2, 0.5, 0.4) for n in (5, 10)),
        *((n, 12, d, 0.3, 0.4) for n in (5, 10) for d in (0.3, 2.0, 2.5, 3.0)),
        *((n, 48, d, 0.3, 0.4) for n in (5, 10) for d in (2.5, 3.0)),
    ):
        rng = np.random.default_rng([seed, people, trials, int(10 * d)])
        who = f"{people} people x {trials} trials, d' {d} (sd {spread})"
        of_pairs(studies, who, lambda rng=rng, a=(people, trials, d, spread, favour): answers(rng, *a))


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
    "ratings": of_ratings,
}
"""Coverage studies by name."""


if __name__ == "__main__":
    main()
