import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from midair.study import chance_macro_f, confusion_matrix, f_measure, scores, wilson

OBJECTS = ["brush", "sponge", "towel"]


def choices(seed, trials=60, people=4, skill=0.5):
    rng = np.random.default_rng(seed)
    truth = np.tile(OBJECTS, trials // 3)
    answer = np.where(rng.random(trials) < skill, truth, rng.choice(OBJECTS, trials))
    return truth, answer, np.arange(trials) % people


def test_by_hand_and_foils_count_as_wrong():
    truth = ["a", "a", "a", "b", "b", "c"]
    answer = ["a", "a", "b", "b", "c", "c"]
    found = confusion_matrix(truth, answer)
    assert found.counts.tolist() == [[2, 1, 0], [0, 1, 1], [0, 0, 1]]
    table = scores(found)
    assert table["precision"].tolist() == pytest.approx([1, 1 / 2, 1 / 2])
    assert table["recall"].tolist() == pytest.approx([2 / 3, 1 / 2, 1])
    assert table["F"].tolist() == pytest.approx([4 / 5, 1 / 2, 2 / 3])
    assert found.accuracy == pytest.approx(4 / 6)
    found = confusion_matrix(["a", "a", "b", "b"], ["a", "x", "b", "b"], foils=["x"])
    assert found.counts.tolist() == [[1, 0, 1], [0, 2, 0]]
    assert found.accuracy == pytest.approx(0.75)
    assert found.f_measure.tolist() == pytest.approx([2 / 3, 1])
    assert scores(found)["answered"].tolist() == [1, 2]
    chance = chance_macro_f(found, rng=np.random.default_rng(0), draws=200)
    assert chance.distribution.max() <= 1
    never = scores(confusion_matrix(["a", "b"], ["a", "a"]))
    assert never["note"][1] == "never answered: precision is undefined"


@pytest.mark.long
@given(seed=st.integers(0, 1000))
def test_agrees_with_scikit_learn(seed):
    metrics = pytest.importorskip("sklearn.metrics")
    truth, answer, _ = choices(seed)
    found = confusion_matrix(truth, answer, labels=OBJECTS)
    assert found.counts.tolist() == metrics.confusion_matrix(truth, answer, labels=OBJECTS).tolist()
    f = metrics.f1_score(truth, answer, labels=OBJECTS, average=None, zero_division=0)
    np.testing.assert_allclose(found.f_measure, f)
    assert found.macro_f == pytest.approx(metrics.f1_score(truth, answer, average="macro", zero_division=0))
    table = scores(found)
    np.testing.assert_allclose(table["recall"], metrics.recall_score(truth, answer, labels=OBJECTS, average=None))


def test_people_add_up():
    truth, answer, who = choices(1)
    found = confusion_matrix(truth, answer, participant=who)
    assert found.by_person.shape == (4, 3, 3)
    assert found.counts.tolist() == confusion_matrix(truth, answer).counts.tolist()
    assert found.macro_f_by_person[2] == pytest.approx(confusion_matrix(truth[who == 2], answer[who == 2]).macro_f)


def test_chance_of_forty_trials_an_object():
    # The null of the paper's Fig. 7: mean .333, middle 95 % .249 to .420, when each answer is drawn at random.
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(40, [1 / 3] * 3, size=(20_000, 3))
    f = f_measure(drawn).mean(axis=-1)
    assert f.mean() == pytest.approx(0.333, abs=0.002)
    assert np.quantile(f, [0.025, 0.975]) == pytest.approx([0.249, 0.420], abs=0.004)
    one = confusion_matrix(np.repeat(OBJECTS, 40), np.tile(OBJECTS, 40))
    chance = chance_macro_f(one, rng=rng, draws=4000)
    assert chance.mean == pytest.approx(1 / 3, abs=0.003)
    assert chance.range95 == pytest.approx((0.249, 0.420), abs=0.006)


def test_permutation_keeps_the_marginal_counts():
    truth, answer, who = choices(3, skill=0.9)
    chance = chance_macro_f(confusion_matrix(truth, answer, participant=who), rng=np.random.default_rng(0), draws=999)
    assert chance.p == pytest.approx(0.001)
    assert chance.value > chance.range95[1]
    same = confusion_matrix(["a", "b", "a", "b"], ["a", "a", "a", "a"], labels=["a", "b"])
    constant = chance_macro_f(same, rng=np.random.default_rng(0), draws=99)
    assert constant.p == 1.0  # constant answers are at chance in every permutation


def test_wilson_by_hand():
    # Newcombe (1998), table 1: 81/263 and 15/148 with the score method.
    assert [round(float(x), 4) for x in wilson(81, 263)] == [0.2553, 0.3662]
    assert [round(float(x), 4) for x in wilson(15, 148)] == [0.0624, 0.1605]
    assert [round(float(x), 4) for x in wilson(0, 20)] == [0.0, 0.1611]
