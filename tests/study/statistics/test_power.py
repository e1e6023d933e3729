import numpy as np
import pytest

from midair.errors import InputError
from midair.study import (
    IdentificationExperiment,
    RatingExperiment,
    paired_t,
    participants_for_median,
    participants_for_paired_t,
    power_curve,
    power_median,
    power_paired_t,
    simulated_power,
)
from midair.study.statistics.power import Published, chance_of_published, published_statistics


@pytest.mark.parametrize(("d_z", "pairs"), [(0.3, 90), (0.5, 34), (0.8, 15)])
def test_pairs_for_eighty_percent(d_z, pairs):
    assert participants_for_paired_t(d_z=d_z) == pairs
    assert power_paired_t(pairs, d_z=d_z) >= 0.8 > power_paired_t(pairs - 1, d_z=d_z)


def test_power_of_a_median_is_that_of_the_sign_test():
    # With 12 people, the limits are the third value from each end: 79 of 4096 sign patterns lie beyond each.
    assert power_median(12, distance=0) == pytest.approx(2 * 79 / 4096)
    assert power_median(5, distance=3) == 0
    many = participants_for_median(distance=1)
    assert power_median(many, distance=1) >= 0.8 > power_median(many - 1, distance=1)
    with pytest.raises(InputError, match=r"expected to reach 0.8 with a distance of 0 and 20 people"):
        participants_for_median(distance=0, most=20)


def test_power_of_three_objects():
    assert power_paired_t(3, d_z=1) == pytest.approx(0.18, abs=0.01)
    assert power_paired_t(10, d_z=0) == pytest.approx(0.05)


@pytest.mark.long
def test_simulation_agrees_with_the_formula():
    def experiment(n, rng):
        return paired_t(rng.normal(0.8, 1, n), np.zeros(n)).p

    found = simulated_power(experiment, 12, rng=np.random.default_rng(0), runs=600)
    assert found.low - 0.01 < power_paired_t(12, d_z=0.8) < found.high + 0.01


@pytest.mark.long
def test_two_levels_of_ratings_are_a_paired_t():
    found = simulated_power(RatingExperiment(means=(3.0, 4.0), noise=1.0), 10, rng=np.random.default_rng(1), runs=300)
    assert found.power == pytest.approx(power_paired_t(10, d_z=1 / np.sqrt(2)), abs=0.09)


@pytest.mark.long
def test_more_people_more_power_and_none_without_an_effect():
    rng = np.random.default_rng(2)
    curve = power_curve(IdentificationExperiment(objects=3, trials=12, d_prime=0.4), [4, 10, 30], rng=rng, runs=200)
    assert (np.diff(curve["power"]) > 0).all()
    null = simulated_power(IdentificationExperiment(objects=3, trials=12, d_prime=0, spread=0), 10, rng=rng, runs=400)
    assert null.low < 0.06


def test_invalid_arguments_are_refused():
    with pytest.raises(InputError, match="100 pairs, got less"):
        participants_for_paired_t(d_z=0.001, most=100)
    with pytest.raises(InputError):
        power_paired_t(1, d_z=1)


@pytest.mark.long
def test_power_is_that_of_the_tests_that_the_report_makes():
    # With two further factors the report corrects for seven effects: a factor that is found in .85 of studies of 20
    # people by itself is found in some .57 of them.
    rng = np.random.default_rng(3)
    alone = simulated_power(RatingExperiment(means=(0.0, 1.0)), 20, rng=rng, runs=100).power
    holm = simulated_power(RatingExperiment(means=(0.0, 1.0), others=(3, 3)), 20, rng=rng, runs=100).power
    assert alone == pytest.approx(0.85, abs=0.12)
    assert holm == pytest.approx(0.57, abs=0.16)
    # The permutation test of macro F; a t-test of shares would give .68.
    found = simulated_power(IdentificationExperiment(objects=3, trials=12, d_prime=0.4), 10, rng=rng, runs=150).power
    assert found == pytest.approx(0.82, abs=0.1)


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
