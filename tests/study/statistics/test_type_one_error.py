"""False positive rate of each test at .05 in two thousand studies without an effect."""

import numpy as np
import pytest

from midair.study import chance_macro_f, confusion_matrix, equivalence, paired_t, rm_anova, sign_flip

PEOPLE = 10
OBJECTS = np.array(["brush", "sponge", "towel"])


def paired(rng):
    return paired_t(rng.normal(size=PEOPLE), rng.normal(size=PEOPLE)).p


UNEVEN = np.diag([0.2, 1.0, 9.0])


def anova(rng, column, effect, covariance=None):
    """Of ratings of 10 people x 2 x 3 with no effect: a person's level, and normal noise."""
    noise = rng.normal(size=(PEOPLE, 2, 3))
    y = noise if covariance is None else noise @ np.linalg.cholesky(covariance).T
    y = y + rng.normal(0, 1, (PEOPLE, 1, 1))
    who, surface, thing = np.indices(y.shape).reshape(3, -1)
    made = {"y": y.ravel(), "who": who, "surface": surface, "object": thing}
    table = rm_anova(made, value="y", participant="who", within=["surface", "object"])
    return table.set_index("effect").loc[effect, column]


def macro_f(rng):
    truth = np.tile(np.repeat(OBJECTS, 4), PEOPLE)
    taste = rng.dirichlet([3, 3, 3], PEOPLE)  # bias without sensitivity
    answer = np.concatenate([rng.choice(OBJECTS, 12, p=p) for p in taste])
    confusion = confusion_matrix(truth, answer, participant=np.repeat(np.arange(PEOPLE), 12), labels=OBJECTS)
    return chance_macro_f(confusion, rng=rng, draws=399).p


# Exact at .05 up to the steps of p: the share must lie in the 99.9 % interval of 2000 throws at .05.
EXACT = {
    "paired t": paired,
    "sign turns": lambda rng: sign_flip(rng.standard_t(3, PEOPLE), rng=rng),
    "sign turns at random": lambda rng: sign_flip(rng.normal(size=(14, 2)), rng=rng, draws=400),
    "equivalence at the margin": lambda rng: equivalence(rng.normal(1.5, 1, PEOPLE), np.zeros(PEOPLE), margin=1.5).p,
    "anova, two levels": lambda rng: anova(rng, "p", "surface"),
    "anova, three levels": lambda rng: anova(rng, "p", "object"),
    "anova, interaction": lambda rng: anova(rng, "p", "surface:object"),
    "macro F": macro_f,
    "anova, uneven, GG": lambda rng: anova(rng, "p_GG", "object", UNEVEN),
    "anova, uneven, HF": lambda rng: anova(rng, "p_HF", "object", UNEVEN),
}
# The Greenhouse-Geisser correction is conservative under sphericity.
SHY = {
    "anova, GG": lambda rng: anova(rng, "p_GG", "object"),
    "anova, interaction, GG": lambda rng: anova(rng, "p_GG", "surface:object"),
}


def found(test):
    """False positives in two thousand studies, and the 99.9 % interval of a rate of .05."""
    from scipy.stats import binom

    rng = np.random.default_rng(1)
    return sum(test(rng) <= 0.05 for _ in range(2000)), *binom.ppf([0.0005, 0.9995], 2000, 0.05)


@pytest.mark.slow
def test_false_positives_in_five_percent(subtests):
    for name, test in EXACT.items():
        with subtests.test(name):
            count, low, high = found(test)
            assert low <= count <= high


@pytest.mark.slow
def test_corrections_are_conservative_and_sphericity_matters():
    for name, test in SHY.items():
        count, _, high = found(test)
        assert 2000 * 0.01 <= count <= high, name
    count, _, high = found(lambda rng: anova(rng, "p", "object", UNEVEN))
    assert count > high
