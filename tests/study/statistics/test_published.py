import numpy as np
import pytest

from midair.study.statistics.power import Published, chance_of_published, published_statistics


def value(table, begin):
    return next(row for row in table.to_dict("records") if row["quantity"].startswith(begin))


def test_published_numbers_are_reproduced():
    table = published_statistics()
    assert value(table, "p of")["value"] == pytest.approx(0.25, abs=0.005)  # "p = .25"
    assert value(table, "power of the test at d_z = 1")["value"] == pytest.approx(0.18, abs=0.01)
    assert value(table, "Bayes")["value"] == pytest.approx(0.919932, rel=1e-5)
    real = value(table, "share right")
    assert real["value"] > 0.95
    assert 114 / 120 <= 0.95 < real["value"] == 115 / 120  # the fewest that are "over 95 %"
    assert value(table, "d' of real")["low"] > 2


def test_limits_of_the_effect_are_percentiles_of_noncentral_t():
    from scipy.stats import nct

    row = value(published_statistics(), "d_z over")
    assert row["low"] < 0 < row["value"] < row["high"]
    assert nct.sf(1.60, 2, row["low"] * 3**0.5) == pytest.approx(0.025, abs=1e-6)
    assert nct.cdf(1.60, 2, row["high"] * 3**0.5) == pytest.approx(0.025, abs=1e-6)


def test_margin_of_equivalence_is_the_smallest_that_passes():
    from midair.study import equivalence

    d = np.array([-1.0, 0, 1]) + 1.60 / 3**0.5
    margin = value(published_statistics(), "smallest margin")["value"]
    assert (
        equivalence(d, np.zeros(3), margin=margin * 1.001).p
        < 0.05
        < equivalence(d, np.zeros(3), margin=margin * 0.999).p
    )


def test_chance_is_a_third_with_a_wide_range():
    chance = chance_of_published(0.45, rng=np.random.default_rng(0))
    assert Published().trials_an_object == 40
    assert chance.mean == pytest.approx(1 / 3, abs=0.002)
    assert chance.range95 == pytest.approx((0.249, 0.420), abs=0.004)
    assert chance.p < 0.01
