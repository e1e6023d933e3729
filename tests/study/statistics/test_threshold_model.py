"""Thresholds against closed forms, and against simulated observers with bias and lapses."""

import numpy as np
import pytest

from midair.errors import InputError, ShapeError
from midair.study import draw_plan, read_design, template_text
from midair.study.statistics import ThresholdModel

LEVELS = np.array([1.0, 3.0, 10.0, 30.0, 100.0])


def model(task, **options):
    return ThresholdModel(task=task, levels=LEVELS, **{"lapse_most": 0.15, **options})


def observer(found):
    """Index and parameters of one observer of the grid."""
    index = found.chance.shape[1] // 3
    place, slope, lapse, bias = (
        axis[one] for axis, one in zip(found.axes, np.unravel_index(index, [len(a) for a in found.axes]), strict=True)
    )
    return index, 1 - np.exp(-((LEVELS / np.exp(place)) ** np.exp(slope))), lapse, bias


def test_yes_and_no_has_false_alarms_and_lapses():
    found = model("detection")
    index, rise, lapse, bias = observer(found)
    assert found.chance[:, index] == pytest.approx(np.r_[bias + (1 - bias - lapse) * rise, bias], abs=2e-6)


def test_two_sides_are_those_of_signal_detection_theory():
    from scipy.stats import norm

    found = model("two sides")
    index, rise, lapse, bias = observer(found)
    d = 2**0.5 * norm.ppf(0.5 + rise / 2)
    # The difference of the two values is normal with mean +-d' and standard deviation sqrt(2).
    first, second = (norm.sf(0, sign * d + 2**0.5 * bias, 2**0.5) for sign in (1, -1))
    expected = lapse + (1 - 2 * lapse) * np.r_[first, second, norm.cdf(bias)]
    assert found.chance[:, index] == pytest.approx(expected, abs=2e-6)


def test_a_choice_has_a_known_guess_rate():
    found = model("choice", alternatives=4)
    index, rise, lapse, _ = observer(found)
    assert found.chance[:, index] == pytest.approx(0.25 + (0.75 - lapse) * rise, abs=2e-6)
    assert found.cells == 5


def test_the_posterior_is_the_product_of_prior_and_binomials():
    from scipy.stats import binom

    found = model("detection", coarse=True)
    yes, total = np.array([0.0, 1, 6, 9, 10, 1]), np.array([4.0, 5, 10, 10, 10, 8])
    likelihood = binom.pmf(yes[:, None], total[:, None], found.chance).prod(axis=0) * np.exp(found.log_prior)
    assert found.posterior(yes, total) == pytest.approx(likelihood / likelihood.sum())


def test_the_next_level_has_the_least_expected_entropy_of_the_threshold():
    found = model("detection", coarse=True)
    yes, total = np.array([0.0, 0, 3, 5, 0, 0]), np.array([1.0, 2, 5, 5, 0, 2])
    weight = found.posterior(yes, total)
    expected = []
    for cell in range(len(LEVELS)):
        entropy = 0.0
        for answer in (1.0, 0.0):
            then = found.posterior(yes + answer * np.eye(6)[cell], total + np.eye(6)[cell])
            marginal = then.reshape(len(found.axes[0]), -1).sum(axis=1)
            share = weight @ (found.chance[cell] if answer else 1 - found.chance[cell])
            entropy -= share * marginal @ np.log(np.maximum(marginal, 1e-300))
        expected.append(entropy)
    assert found.next_level(weight) == np.argmin(expected)


def estimate(found, yes, total):
    return found.estimate(np.array(yes, float), np.array(total, float), rng=np.random.default_rng(1))


def test_expected_answers_give_the_true_parameters():
    rise = 1 - np.exp(-((LEVELS / 8) ** 2))
    total = np.full(6, 80)
    one = estimate(model("detection"), np.rint(total * np.r_[0.2 + 0.76 * rise, 0.2]), total)
    assert one.low < 8 < one.high
    assert one.threshold == pytest.approx(8, rel=0.1)
    assert (one.bias, one.lapse) == (pytest.approx(0.2, abs=0.03), pytest.approx(0.04, abs=0.02))
    assert one.p_misfit > 0.2


@pytest.mark.parametrize(
    ("yes", "total", "why"),
    [
        ([20, 0, 20, 0, 20, 0], [20] * 6, "does not fit"),
        ([0, 0, 0, 0, 0, 0], [20] * 6, "beyond the levels"),
        ([1, 1, 1, 2, 2, 1], [2] * 6, "a factor of"),
    ],
)
def test_refusals_have_a_reason(yes, total, why):
    assert why in estimate(model("detection"), yes, total).refusal(LEVELS)


def test_impossible_input_is_refused():
    with pytest.raises(InputError, match="above 0"):
        ThresholdModel(task="detection", levels=np.array([0.0, 1.0]), lapse_most=0.1)
    with pytest.raises(InputError, match="lapse_most"):
        model("detection", lapse_most=0.5)
    with pytest.raises(ShapeError, match="6 cells"):
        model("detection").posterior(np.zeros(5), np.zeros(5))


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
    from scipy.special import ndtr, ndtri

    rise = -np.expm1(-((level / threshold) ** slope))
    z = ndtri(np.minimum(0.5 + rise / 2, 1 - 1e-12))
    if task == "two sides":
        return lapse + (1 - 2 * lapse) * ndtr(np.where(second, -z, z) + bias)
    return bias + (1 - bias - lapse) * rise


def block_of_template() -> tuple[np.ndarray, list[str]]:
    """Levels of the template `detection`, and the roles of the trials of its adaptive block for one participant."""
    plan = draw_plan(read_design(template_text("detection"), participants=1))
    block = next(one for one in plan.design.blocks if one.adaptive)
    levels = {float(plan.design.stimulus(name).levels[block.strength]) for name in block.stimuli}
    return np.array(sorted(levels)), [trial.role for trial in plan.trials if trial.block == block.name]


@pytest.mark.long
@pytest.mark.parametrize(
    ("task", "bias", "lapse", "slope"),
    [("yes-no", 0.2, 0.04, 1.2), ("yes-no", 0.35, 0.04, 3), ("two sides", 0.5, 0.04, 1.2), ("two sides", 1.0, 0.0, 3)],
)
def test_simulated_observers_have_unbiased_thresholds(task, bias, lapse, slope):
    rng = np.random.default_rng(7)
    shift, covered, refused = after(rng, task, 150, bias=bias, lapse=lapse, slope=slope)
    # The standard error of the bias is 2 to 3 %, that of a coverage of 95 % is 1.8 %.
    assert abs(shift) < 15
    assert covered > 89
    assert refused < 10
