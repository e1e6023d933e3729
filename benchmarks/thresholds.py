"""Bias and coverage of thresholds of simulated observers: `python -m benchmarks.thresholds`.

An observer has a Weibull function with a threshold of 4 to 40 % (log uniform), and answers as `ThresholdModel` states.
"yes-no": false alarms as guesses, so that "yes" has the probability a + (1 - a - lapse) F. "criterion": an observer of
signal detection theory who says yes if a normal value exceeds a criterion, with the same false-alarm rate and the same
sensitivity as the two-interval observer; its yes-no threshold depends on the criterion. Levels and numbers of trials
are those of the template `detection`, also for yes and no.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.special import ndtr, ndtri

from benchmarks.clock import load
from midair.study import draw_plan, read_design, template_text
from midair.study.statistics import ThresholdModel

SLOPES = (1.2, 3.0, 6.0)
LAPSES = (0.0, 0.04, 0.1)
BIASES = {"two sides": (0.0, 0.5, 1.0), "yes-no": (0.0, 0.05, 0.2, 0.35), "criterion": (0.05, 0.2)}
"""Side biases in standard deviations, or false-alarm rates."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.thresholds", description=__doc__.splitlines()[0])
    parser.add_argument("--observers", type=int, default=500, help="simulated observers per line (default 500)")
    parser.add_argument("--task", choices=list(BIASES), nargs="*", default=list(BIASES))
    parser.add_argument("--bias", type=float, nargs="*", help="side biases or false-alarm rates (default all)")
    parser.add_argument("--seed", type=int, default=2026, help="random seed (default 2026)")
    options = parser.parse_args()
    print(load())
    print("task       bias  lapse  slope   bias %  coverage %  refused %")
    for task in options.task:
        for bias in options.bias or BIASES[task]:
            for lapse in LAPSES:
                for slope in SLOPES:
                    rng = np.random.default_rng([options.seed, int(100 * bias), int(100 * lapse), int(10 * slope)])
                    observer = {"bias": bias, "lapse": lapse, "slope": slope}
                    shift, covered, refused = after(rng, task, options.observers, **observer)
                    print(
                        f"{task:9} {bias:5.2f} {lapse:6.2f} {slope:6.1f} {shift:+8.1f} {covered:11.1f} {refused:10.1f}",
                        flush=True,
                    )
    print(load())


def after(
    rng: np.random.Generator, task: str, observers: int, *, bias: float, lapse: float, slope: float
) -> tuple[float, float, float]:
    """Bias (%), coverage (%) and refused thresholds (%) of midair's estimate; bias and coverage without the refused."""
    levels, trials = block_of_template()
    kind = "two sides" if task == "two sides" else "detection"
    fine, coarse = (
        ThresholdModel(task=kind, levels=levels, lapse_most=0.15, coarse=coarse) for coarse in (False, True)
    )
    true = np.exp(rng.uniform(np.log(4), np.log(40), observers))
    counted, total = np.zeros((2, observers, fine.cells))
    who, top = np.arange(observers), len(levels) - 1
    sides = rng.permuted(np.tile(np.arange(len(trials)) % 2, (observers, 1)), axis=1)
    for number, role in enumerate(trials):
        index = np.full(observers, top)
        if role == "test":
            index = coarse.next_level(coarse.posterior(counted, total))
        second = sides[:, number] == 1
        x = np.zeros(observers) if role == "catch" else levels[index]
        yes = rng.random(observers) < chance(task, x, true, second, bias=bias, lapse=lapse, slope=slope)
        cell = index + (len(levels) * second if kind == "two sides" else 0)
        cell = np.full(observers, fine.cells - 1) if role == "catch" else cell
        counted[who, cell] += yes
        total[who, cell] += 1
    found = [fine.estimate(one, many, rng=rng, draws=200) for one, many in zip(counted, total, strict=True)]
    kept = np.array([not one.refusal(levels) for one in found])
    inside = np.array([one.low <= value <= one.high for one, value in zip(found, true, strict=True)])
    error = np.log([one.threshold for one in found]) - np.log(true)
    return 100 * float(np.expm1(error[kept].mean())), 100 * float(inside[kept].mean()), 100 * float(1 - kept.mean())


def chance(
    task: str,
    level: np.ndarray,
    threshold: np.ndarray | float,
    second: np.ndarray | bool,
    *,
    bias: float,
    lapse: float,
    slope: float,
) -> np.ndarray:
    """Probability of "yes", or of the first side; `second` states whether the second side is correct."""
    rise = -np.expm1(-((level / threshold) ** slope))
    z = ndtri(np.minimum(0.5 + rise / 2, 1 - 1e-12))
    if task == "two sides":
        return lapse + (1 - 2 * lapse) * ndtr(np.where(second, -z, z) + bias)
    if task == "yes-no":
        return bias + (1 - bias - lapse) * rise
    return np.minimum(ndtr(2**0.5 * z + ndtri(bias)), 1 - lapse)


def block_of_template() -> tuple[np.ndarray, list[str]]:
    """Levels of the template `detection`, and the roles of the trials of its adaptive block for one participant."""
    plan = draw_plan(read_design(template_text("detection"), participants=1))
    block = next(one for one in plan.design.blocks if one.adaptive)
    levels = {float(plan.design.stimulus(name).levels[block.strength]) for name in block.stimuli}
    return np.array(sorted(levels)), [trial.role for trial in plan.trials if trial.block == block.name]


if __name__ == "__main__":
    main()
