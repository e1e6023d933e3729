from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.errors import InputError
from midair.study.design.plan import balanced_latin_square, constrained_shuffle, longest_run_of


@pytest.mark.parametrize("count", range(1, 11))
def test_square_is_balanced(count):
    square = balanced_latin_square(count)
    assert len(square) == (2 * count if count % 2 and count > 1 else count)
    for place in range(count):
        assert set(Counter(row[place] for row in square).values()) == {len(square) // count}
    after = Counter(pair for row in square for pair in pairwise(row))
    assert len(after) == count * (count - 1)
    assert len(set(after.values())) <= 1


def test_square_by_hand():
    assert balanced_latin_square(4) == [[0, 1, 3, 2], [1, 2, 0, 3], [2, 3, 1, 0], [3, 0, 2, 1]]


@given(
    counts=st.lists(st.integers(1, 6), min_size=1, max_size=4),
    longest=st.integers(1, 3),
    seed=st.integers(0, 100),
    tries=st.sampled_from([0, 20]),
)
def test_shuffle_keeps_items_and_limit_or_raises(counts, longest, seed, tries):
    items = [i for i, count in enumerate(counts) for _ in range(count)]
    possible = max(counts) <= longest * (sum(counts) - max(counts) + 1)
    rng = np.random.default_rng(seed)
    if not possible:
        with pytest.raises(InputError, match="allow longer runs"):
            constrained_shuffle(items, rng=rng, longest_run=longest, tries=tries)
        return
    order = constrained_shuffle(items, rng=rng, longest_run=longest, tries=tries)
    assert sorted(order) == items
    assert longest_run_of(order) <= longest


def test_allowed_orders_are_equally_likely():
    rng = np.random.default_rng(0)
    seen = Counter(tuple(constrained_shuffle("aabbc", rng=rng, longest_run=1)) for _ in range(6000))
    assert len(seen) == 12  # orders of aabbc without equal neighbours
    assert max(seen.values()) < 1.25 * 6000 / 12
    assert min(seen.values()) > 0.75 * 6000 / 12


def test_without_a_limit():
    assert sorted(constrained_shuffle("aaa", rng=np.random.default_rng(0))) == list("aaa")
    with pytest.raises(InputError):
        balanced_latin_square(0)
