import numpy as np
import pytest

from midair.errors import InputError
from midair.study import Psychometric, QuestPlus, Staircase


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


def quest():
    return QuestPlus(
        levels=np.linspace(0.5, 8, 16),
        thresholds=np.linspace(1, 6, 21),
        slopes=[2, 4],
        lapses=[0.02],
        guess=1 / 3,
    )


def test_next_level_has_the_least_expected_entropy():
    state = quest().answered(3, True).answered(2, False)

    def entropy(one):
        p = one.belief[one.belief > 0]
        return -(p * np.log(p)).sum()

    expected = []
    for level in state.levels:
        chance = (state.likelihood(level) * state.belief).sum()
        expected.append(
            chance * entropy(state.answered(level, True)) + (1 - chance) * entropy(state.answered(level, False))
        )
    assert state.next_level == state.levels[int(np.argmin(expected))]


def test_quest_is_bayes_rule():
    state = quest().answered(3, True).answered(4, False)
    other = quest().answered(4, False).answered(3, True)
    np.testing.assert_allclose(state.belief, other.belief)
    by_hand = quest().likelihood(3) * (1 - quest().likelihood(4))
    np.testing.assert_allclose(state.belief, by_hand / by_hand.sum())


def test_quest_finds_the_threshold():
    rng = np.random.default_rng(1)
    true = Psychometric(threshold=3.2, slope=4, guess=1 / 3, lapse=0.02, shape="weibull")
    misses = []
    for _ in range(12):
        state = quest()
        for _ in range(60):
            level = state.next_level
            state = state.answered(level, rng.random() < true.probability(level))
        mean, sd = state.threshold
        misses.append((mean - 3.2) / sd)
    assert np.abs(np.mean(misses)) < 1
    assert np.std(misses) < 2


def test_impossible_answers_are_refused():
    state = QuestPlus(levels=[1, 100], thresholds=[1.0], slopes=[3], lapses=[0.0], guess=0.5)
    with pytest.raises(InputError, match="lapses above 0"):
        state.answered(100, False)
