from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import expit, logit

from midair.errors import InputError
from midair.study import d_prime_choice, d_prime_same_different, d_prime_yes_no, f_measure, proportion_correct
from midair.study.statistics.detection import d_prime_limits, f_limits, macro_f_limits, share_limits, two_answers_limits


def test_chance_two_and_three_alternatives():
    from scipy.stats import norm

    for alternatives in (2, 3, 5, 10):
        assert proportion_correct(0, alternatives=alternatives) == pytest.approx(1 / alternatives)
    assert proportion_correct(1.3, alternatives=2) == pytest.approx(norm.cdf(1.3 / np.sqrt(2)))
    found = proportion_correct([0.5, 1, 1.5, 2, 3], alternatives=3)
    assert np.round(found, 3).tolist() == [0.483, 0.634, 0.766, 0.866, 0.969]


@given(d=st.floats(0.05, 3.5), alternatives=st.integers(2, 8))
def test_d_prime_of_share_inverts_proportion_correct(d, alternatives):
    total = 1_000_000
    correct = round(total * float(proportion_correct(d, alternatives=alternatives)))
    found = d_prime_choice(correct, total, alternatives=alternatives)
    assert found.d_prime == pytest.approx(d, abs=0.01)
    assert found.low < found.d_prime < found.high
    assert not found.corrected


def test_perfect_answers_stay_finite_and_their_limits_do_not():
    found = d_prime_choice(12, 12, alternatives=3)
    assert found.corrected
    assert np.isfinite(found.d_prime)
    assert found.low < found.d_prime
    assert d_prime_choice(0, 12, alternatives=3).d_prime < 0
    for total, alternatives in product([12, 40, 41], [2, 3, 8]):
        assert d_prime_choice(total, total, alternatives=alternatives).high == np.inf
        assert d_prime_choice(0, total, alternatives=alternatives).low == -np.inf


def test_yes_no_by_hand():
    from scipy.stats import norm

    found = d_prime_yes_no(69, 100, 30, 100)
    hit, alarm = 69.5 / 101, 30.5 / 101
    assert found.d_prime == pytest.approx(norm.ppf(hit) - norm.ppf(alarm))
    assert found.criterion == pytest.approx(-(norm.ppf(hit) + norm.ppf(alarm)) / 2)
    assert np.isfinite(d_prime_yes_no(20, 20, 0, 20).d_prime)
    # At 8 signals and 8 blanks the limits would cover up to .987 of a 95 % interval.
    few, enough = d_prime_yes_no(15, 19, 3, 40), d_prime_yes_no(16, 20, 3, 40)
    assert np.isnan([few.low, few.high]).all()
    assert enough.low < enough.d_prime < enough.high


def test_same_different_of_a_simulated_observer():
    rng = np.random.default_rng(1)
    n, d, k = 200_000, 1.5, 1.2
    noise = rng.normal(0, np.sqrt(2), (2, n))
    found = d_prime_same_different(int((np.abs(d + noise[0]) > k).sum()), n, int((np.abs(noise[1]) > k).sum()), n)
    assert found.d_prime == pytest.approx(d, abs=0.02)
    assert found.criterion == pytest.approx(k, abs=0.02)
    assert d_prime_same_different(10, 20, 12, 20).d_prime == 0


@pytest.fixture
def counts():
    right = np.array([[4, 4, 3], [4, 3, 4], [2, 3, 3], [4, 4, 4], [3, 2, 2], [4, 3, 3]])
    table = np.zeros((6, 3, 3), int)
    for thing in range(3):
        table[:, thing, thing] = right[:, thing]
        table[:, thing, (thing + 1) % 3] = 4 - right[:, thing]
    return table


def test_the_share_by_hand(counts):
    from scipy.stats import t

    right = np.trace(counts, axis1=1, axis2=2)
    without = logit((right.sum() - right + 1) / (60 + 2))
    half = t.ppf(0.975, 5) * np.sqrt(5 / 6 * ((without - without.mean()) ** 2).sum())
    found = share_limits(counts)
    assert float(found.value) == right.sum() / 72
    known = expit(logit((right.sum() + 1) / 74) + np.array([-half, half]))
    assert [float(found.low), float(found.high)] == pytest.approx(known.tolist())


def test_d_prime_has_the_limits_of_the_share_and_f_those_of_each_object(counts):
    share, sense = share_limits(counts), d_prime_limits(counts)
    assert proportion_correct([sense.low, sense.high], alternatives=3) == pytest.approx(
        [float(share.low), float(share.high)]
    )
    right = int(np.trace(counts.sum(axis=0)))
    assert float(sense.value) == pytest.approx(d_prime_choice(right, 72, alternatives=3).d_prime)
    found = f_limits(counts)
    assert found.value.tolist() == f_measure(counts.sum(axis=0)).tolist()
    assert ((found.low < found.value) & (found.value < found.high)).all()
    # An answer that names none of the objects is one more column, and adds to no object.
    foil = np.concatenate([counts, np.ones((6, 3, 1), int)], axis=2)
    assert f_limits(foil).value.shape == (3,)


def test_four_people_and_people_who_are_always_right_have_none(counts):
    perfect = np.stack([4 * np.eye(3, dtype=int)] * 6)
    for limits in (share_limits, f_limits, macro_f_limits, d_prime_limits):
        with pytest.raises(InputError, match="got 4"):
            limits(counts[:4])
        assert np.isnan(limits(perfect).low).all(), limits


def test_few_wrong_answers_have_at_least_the_limits_of_independent_ones():
    """Three of sixty answers are wrong, by three of five people: too few to estimate differences between people."""
    wrong = np.array([1, 1, 1, 0, 0])
    table = np.stack([4 * np.eye(3, dtype=int)] * 5)
    table[:, 0, 0] -= wrong
    table[:, 0, 1] += wrong
    share = (57 + 1) / (60 + 2)
    half = 1.96 / np.sqrt(62 * share * (1 - share))
    found = share_limits(table)
    assert [float(found.low), float(found.high)] == pytest.approx(
        expit(logit(share) + np.array([-half, half])), abs=1e-5
    )


def test_two_answers_need_enough_signals_and_blanks():
    for measure, least in ((d_prime_yes_no, 60), (d_prime_same_different, 240)):
        enough = np.array([[k, 12, 3, 12] for k in (8, 9, 10, 7, 11)]) * (least // 60)
        found = two_answers_limits(measure, enough)
        assert found.low < found.value < found.high
        assert float(found.value) == measure(*enough.sum(axis=0).tolist()).d_prime
        with pytest.raises(InputError, match=f"expected {least} or more signals and blanks in all, got {least - 1}"):
            two_answers_limits(measure, enough - np.array([[0, 0, 0, 1]] + [[0, 0, 0, 0]] * 4))


@pytest.mark.long
def test_limits_cover_near_a_share_of_one():
    # On the logit alone they hold the true share in .98 of studies of five people with twelve trials.
    def drawn(people):
        x = rng.normal(size=(people, 3, 4, 3)) + rng.normal(0, 0.4, (people, 1, 1, 3))
        x[:, [0, 1, 2], :, [0, 1, 2]] += rng.normal(d, 0.3, people)[None, :, None]
        return (x.argmax(axis=-1)[..., None] == np.arange(3)).sum(axis=2)

    for d in (2.5, 3.0):
        rng = np.random.default_rng(int(10 * d))
        many = drawn(200_000).sum(axis=0)
        true = np.trace(many) / many.sum()
        found = [share_limits(drawn(5)) for _ in range(2000)]
        held = [one.low <= true <= one.high for one in found if np.isfinite(one.low)]
        assert len(held) > 1700
        assert 0.935 < np.mean(held) < 0.97, d
