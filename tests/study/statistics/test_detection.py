import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import InputError
from midair.study import d_prime_choice, d_prime_same_different, d_prime_yes_no, proportion_correct


def test_three_alternatives():
    found = proportion_correct([0.5, 1, 1.5, 2, 3], alternatives=3)
    assert np.round(found, 3).tolist() == [0.483, 0.634, 0.766, 0.866, 0.969]


@pytest.mark.parametrize("alternatives", [2, 3, 5, 10])
def test_chance_and_two_alternatives(alternatives):
    from scipy.stats import norm

    assert proportion_correct(0, alternatives=alternatives) == pytest.approx(1 / alternatives)
    assert proportion_correct(1.3, alternatives=2) == pytest.approx(norm.cdf(1.3 / np.sqrt(2)))


@given(d=st.floats(0.05, 3.5), alternatives=st.integers(2, 8))
def test_d_prime_of_share_inverts_proportion_correct(d, alternatives):
    total = 1_000_000
    correct = round(total * float(proportion_correct(d, alternatives=alternatives)))
    found = d_prime_choice(correct, total, alternatives=alternatives)
    assert found.d_prime == pytest.approx(d, abs=0.01)
    assert not found.corrected


def test_perfect_answers_stay_finite():
    found = d_prime_choice(12, 12, alternatives=3)
    assert found.corrected
    assert np.isfinite(found.d_prime)
    assert d_prime_choice(0, 12, alternatives=3).d_prime < 0


def test_yes_no_by_hand():
    from scipy.stats import norm

    found = d_prime_yes_no(69, 100, 30, 100)
    hit, alarm = 69.5 / 101, 30.5 / 101
    assert found.d_prime == pytest.approx(norm.ppf(hit) - norm.ppf(alarm))
    assert found.criterion == pytest.approx(-(norm.ppf(hit) + norm.ppf(alarm)) / 2)
    assert np.isfinite(d_prime_yes_no(20, 20, 0, 20).d_prime)


def test_same_different_of_a_simulated_observer():
    rng = np.random.default_rng(1)
    n, d, k = 200_000, 1.5, 1.2
    noise = rng.normal(0, np.sqrt(2), (2, n))
    found = d_prime_same_different(int((np.abs(d + noise[0]) > k).sum()), n, int((np.abs(noise[1]) > k).sum()), n)
    assert found.d_prime == pytest.approx(d, abs=0.02)
    assert found.criterion == pytest.approx(k, abs=0.02)
    assert d_prime_same_different(10, 20, 12, 20).d_prime == 0


def test_invalid_counts_are_refused():
    with pytest.raises(InputError, match="0 <= hits <= total"):
        d_prime_choice(5, 4, alternatives=3)
    with pytest.raises(InputError, match="2 or more"):
        proportion_correct(1, alternatives=1)
