import numpy as np
import pytest

from midair.errors import InputError
from midair.study import Psychometric, Staircase


def test_staircase_by_hand():
    state = Staircase(level=10, steps=(4, 2, 1))
    seen = []
    for correct in (1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0, 0):
        state = state.answered(bool(correct))
        seen.append(state.level)
    #        down after 3    after 6, up 2 (first turn)   down 1     up 1  up 1
    assert seen == [10, 10, 6, 6, 6, 2, 4, 4, 4, 3, 4, 5]
    assert state.turned == (2, 4, 3)
    assert state.threshold(last=2) == 3.5


def test_staircase_converges_to_79_percent_correct():
    rng = np.random.default_rng(0)
    true = Psychometric(threshold=0, slope=1, shape="normal")
    found = []
    for _ in range(40):
        state = Staircase(level=2, steps=(0.5, 0.2, 0.1))
        while len(state.turned) < 24:
            state = state.answered(rng.random() < true.probability(state.level))
        found.append(state.threshold(last=20))
    assert np.mean(true.probability(found)) == pytest.approx(0.5 ** (1 / 3), abs=0.02)


def test_staircase_stays_within():
    state = Staircase(level=1, steps=(5,), low=0, high=3)
    assert state.answered(False).level == 3
    with pytest.raises(InputError, match="reversals"):
        state.threshold()
    with pytest.raises(InputError, match="within"):
        Staircase(level=9, steps=(1,), high=3)
