"""The commands `study power` and `study paper`."""

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from midair.cli.console import out
from midair.errors import InputError
from midair.figures import png_bytes
from midair.files import atomic_file
from midair.progress import report_progress
from midair.study import (
    EquivalenceExperiment,
    Experiment,
    IdentificationExperiment,
    PowerTest,
    RatingExperiment,
    chance_figure,
    chance_of_published,
    participants_for_paired_t,
    power_curve,
    power_figure,
    power_paired_t,
    published_statistics,
)


def power_command(
    test: PowerTest,
    /,
    *,
    effect: float,
    objects: int = 3,
    trials: int = 12,
    others: Annotated[tuple[int, ...], Parameter(consume_multiple=True)] = (3, 3),
    power: float = 0.8,
    runs: int = 500,
    seed: int = 0,
) -> None:
    """Estimate how many participants a planned test needs.

    Parameters
    ----------
    test
        Test of the report; the first two by formula, the others by simulation.
        paired: paired t-test.
        threshold: the confidence interval of the mean threshold excludes a bound.
        identification: macro F against shuffled answers.
        rating: a factor of two levels in the analysis of variance, Holm-corrected for all its effects.
        equivalence: two equal conditions are shown to differ by less than a margin.
    effect
        Effect size, which depends on the test.
        paired: d_z. identification: mean d'. rating: difference in rating steps.
        equivalence: margin over the standard deviation of the participants' differences.
        threshold: distance of the bound over the standard deviation of the participants' log thresholds.
    objects
        Alternatives of the choice.
    trials
        Trials per participant.
    others
        Levels of each further factor of the ratings; the default is the paper's.
    power
        Power to reach.
    runs
        Simulated studies per number of participants.
    seed
        Random seed of the simulation.

    Examples
    --------
    $ midair study power paired --effect 0.8
    """
    if not 0 < power < 1:
        raise InputError(f"--power: expected between 0 and 1, got {power:g}")
    if test in ("paired", "threshold"):
        many, what = participants_for_paired_t(d_z=effect, power=power), "pairs" if test == "paired" else "thresholds"
        out().print(f"{many} {what} for power {power:g} at {'d_z' if test == 'paired' else 'a distance'} = {effect:g}.")
        return
    experiment: Experiment = {
        "identification": IdentificationExperiment(objects=objects, trials=trials, d_prime=effect),
        "rating": RatingExperiment(means=(0.0, effect), others=others),
        "equivalence": EquivalenceExperiment(margin=effect),
    }[test]
    curve = power_curve(experiment, [3, 5, 8, 10, 12, 16, 20, 30, 40], rng=np.random.default_rng(seed), runs=runs)
    for row in curve.to_dict("records"):
        out().print(
            f"{row['participants']:>4} participants: power {row['power']:.2f} ({row['low']:.2f} to {row['high']:.2f})"
        )
    enough = curve["participants"][curve["power"] >= power].tolist()
    out().print(f"Enough for {power:g}: {enough[0]}." if enough else f"More than 40 are needed for {power:g}.")


def paper_command(output: Path | None = None, /, *, seed: int = 0) -> None:
    """Recompute the paper's published statistics, with their chance levels and power.

    Parameters
    ----------
    output
        Folder for two figures. [default: no figures]
    seed
        Random seed of the chance distribution.

    Examples
    --------
    $ midair study paper figures
    """
    for row in published_statistics().to_dict("records"):
        limits = "" if np.isnan(row["low"]) else f" ({row['low']:.3f} to {row['high']:.3f})"
        out().print(f"{row['quantity']}: {row['value']:.4f}{limits}")
    chance = chance_of_published(rng=np.random.default_rng(seed))
    low, high = chance.range95
    out().print(f"macro F by chance: mean {chance.mean:.3f}, middle 95 % {low:.3f} to {high:.3f}")
    if output is None:
        return
    from pandas import DataFrame

    output.mkdir(parents=True, exist_ok=True)
    pairs = range(3, 61)
    power = {d_z: [power_paired_t(n, d_z=d_z) for n in pairs] for d_z in (0.3, 0.5, 0.8)}
    curves = [(f"d_z = {d_z:g}", DataFrame({"participants": pairs, "power": p})) for d_z, p in power.items()]
    drawn = {"paper-chance.png": chance_figure(chance, simulated=True), "paper-power.png": power_figure(curves)}
    for name, figure in report_progress(drawn.items(), len(drawn)):
        with atomic_file(output / name) as partial:
            partial.write_bytes(png_bytes(figure))
    out().print(f"{output}: paper-chance.png, paper-power.png")
