"""Statistics that follow from the numbers printed in section 5.3 of the paper: `python -m benchmarks.paper_statistics`.

With --figures FOLDER it draws the chance level of macro F and the power of a paired t-test (docs/paper-statistics.md).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import scipy

from midair.figures import STYLE, new_figure, plain_axes, png_bytes
from midair.files import write_file
from midair.study import bayes_factor, d_prime_choice, f_measure, power_paired, wilson

T = 1.60
"""Student's t of the paired test over objects, two surfaces."""
OBJECTS = 3
"""Pairs of that test, and alternatives of the choice."""
PEOPLE, TRIALS = 10, 12
"""Trials of each person with real objects, and with each surface."""
CORRECT = 0.95
"""Share of correct answers with real objects, printed as "over 95 %"."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.paper_statistics", description=__doc__.splitlines()[0])
    parser.add_argument("--figures", type=Path, help="folder for the two figures (default: none)")
    parser.add_argument("--draws", type=int, default=20_000, help="simulated studies of people who guess")
    args = parser.parse_args()
    for name, value in published().items():
        print(f"{name}: {', '.join(f'{one:.4g}' for one in np.atleast_1d(value))}")
    chance = chance_of_macro_f(args.draws)
    low, high = np.quantile(chance, [0.025, 0.975])
    print(f"macro F by chance: mean {chance.mean():.3f}, middle 95 % {low:.3f} to {high:.3f}")
    if args.figures is not None:
        args.figures.mkdir(parents=True, exist_ok=True)
        draw(args.figures, chance, low, high)


def published() -> dict[str, object]:
    """Each quantity with its value, or with value, lower and upper 95 % limit."""
    d_z, df = T / OBJECTS**0.5, OBJECTS - 1
    total = PEOPLE * TRIALS
    fewest = int(np.floor(CORRECT * total)) + 1  # "over 95 %": the smallest number of answers above it
    low, high = wilson(fewest, total)
    sense = d_prime_choice(fewest, total, alternatives=OBJECTS)
    limits = [limit / OBJECTS**0.5 for limit in noncentral_t_limits(T, df)]
    return {
        "p of t(2) = 1.60, two-sided": 2 * scipy.stats.t.sf(T, df),
        "d_z over objects": [d_z, *limits],
        **{f"power of the test at d_z = {d:g}": power_paired(OBJECTS, effect=d) for d in (0.5, 1, 2)},
        "smallest margin of equivalence at .05, in standard deviations": d_z
        + scipy.stats.t.ppf(0.95, df) / OBJECTS**0.5,
        "Bayes factor for a difference": bayes_factor(T, OBJECTS),
        f"share right of real objects, at least {fewest} of {total}": [fewest / total, low, high],
        f"d' of real objects at {fewest} of {total}": [sense.d_prime, sense.low, sense.high],
    }


def noncentral_t_limits(t: float, df: int) -> list[float]:
    """95 % limits of the noncentrality of an observed t (Cumming and Finch, 2001)."""
    return [
        float(scipy.optimize.brentq(lambda ncp, tail=tail: scipy.special.nctdtr(df, ncp, t) - tail, -30, 60))
        for tail in (0.975, 0.025)
    ]


def chance_of_macro_f(draws: int) -> np.ndarray:
    """Macro F of people who answer at random, with the paper's number of trials, shape (draw,)."""
    each = PEOPLE * TRIALS // OBJECTS
    counts = np.random.default_rng(0).multinomial(each, [1 / OBJECTS] * OBJECTS, size=(draws, OBJECTS))
    return f_measure(counts).mean(axis=-1)


def draw(folder: Path, chance: np.ndarray, low: float, high: float) -> None:
    figure = new_figure(5, 2.8, simulated=True)
    axes = plain_axes(figure.add_subplot(), x=f"macro F by chance; shaded: middle 95 %, {low:.3f} to {high:.3f}")
    axes.hist(chance, bins=40, color=STYLE.before, density=True)
    axes.axvspan(low, high, color=STYLE.band, zorder=0)
    write_file(folder / "paper-chance.png", png_bytes(figure))
    figure = new_figure(5, 3, simulated=False)
    axes = plain_axes(figure.add_subplot(), x="pairs or participants", y="power")
    for d_z, line in ((0.3, "-"), (0.5, "--"), (0.8, ":")):
        power = [power_paired(n, effect=d_z) for n in range(3, 61)]
        axes.plot(range(3, 61), power, line, label=f"d_z = {d_z:g}", color=STYLE.reproduced)
    axes.axhline(0.8, color=STYLE.ink, linewidth=0.8, linestyle=":")
    axes.legend(fontsize=8, frameon=False)
    write_file(folder / "paper-power.png", png_bytes(figure))


if __name__ == "__main__":
    main()
