import numpy as np
import pytest

from midair.study.statistics.anova import rm_anova
from midair.study.statistics.detection import proportion_correct
from midair.study.statistics.paired import equivalence
from midair.study.statistics.power import (
    POWER,
    participants_for,
    power_equivalence,
    power_identification,
    power_paired,
    power_rating,
    power_threshold,
)


def test_participants_for_eighty_percent():
    found = {d_z: participants_for("paired", effect=d_z) for d_z in (0.3, 0.5, 0.8)}
    assert found == {0.3: 90, 0.5: 34, 0.8: 15}  # as of G*Power and pwr of R
    for test in POWER:
        many = participants_for(test, effect=0.5)
        assert POWER[test](many, effect=0.5) >= 0.8 > POWER[test](many - 1, effect=0.5), test


def test_power_without_an_effect_is_the_level():
    assert power_paired(3, effect=1) == pytest.approx(0.18, abs=0.01)
    assert power_paired(10, effect=0) == pytest.approx(0.05)
    assert power_rating(10, effect=0, others=(3, 3)) == pytest.approx(0.05 / 7)
    assert power_identification(10, effect=0, spread=0) == pytest.approx(0.05, abs=0.02)
    # With 12 people, the limits are the third value from each end: 79 of 4096 sign patterns lie beyond each.
    assert power_threshold(12, effect=0) == pytest.approx(2 * 79 / 4096)
    assert power_threshold(5, effect=3) == 0


def test_simulated_tests_have_the_power_of_the_formulas():
    from scipy.stats import binomtest

    rng, runs = np.random.default_rng(3), 300
    equal = [equivalence(rng.normal(size=12), np.zeros(12), margin=1.0).p < 0.05 for _ in range(runs)]
    assert np.mean(equal) == pytest.approx(power_equivalence(12, effect=1.0), abs=0.08)
    share = [proportion_correct(rng.normal(0.4, 0.3, 8), alternatives=3) for _ in range(runs)]
    told = [int(rng.binomial(12, each).sum()) for each in share]
    found = [binomtest(right, 96, 1 / 3, alternative="greater").pvalue < 0.05 for right in told]
    assert np.mean(found) == pytest.approx(POWER["identification"](8, effect=0.4), abs=0.08)


def test_a_rating_of_two_levels_is_a_paired_t():
    rng, found = np.random.default_rng(1), []
    who, level = (each.ravel() for each in np.indices((10, 2)))
    for _ in range(60):
        y = level + rng.normal(0, 1, who.size) + rng.normal(0, 0.8, 10)[who]
        table = rm_anova({"y": y, "who": who, "level": level}, value="y", participant="who", within=["level"])
        found.append(table["p_GG"][0] < 0.05)
    assert np.mean(found) == pytest.approx(power_rating(10, effect=1.0), abs=0.2)
