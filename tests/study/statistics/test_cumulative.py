from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import approx_fprime

from midair.errors import InputError
from midair.study import cumulative_mixed
from midair.study.statistics.cumulative import RandomEffects, _Likelihood

HERE = Path(__file__).parent / "mixed"
DESIGNS = {  # factors, item
    "items": (["surface"], "item"),
    "items_two_way": (["surface", "object"], "item"),
    "seven_points": (["surface", "object"], ""),
    "four_points_items": (["object"], "item"),
    "five_points_slopes": (["surface", "object"], ""),
}


@pytest.mark.parametrize("name", DESIGNS)
def test_equals_glmer_and_clmm(name):
    """Two answers are compared with glmer, more with clmm: see mixed/crossed.R."""
    within, item = DESIGNS[name]
    table = pd.read_csv(HERE / f"{name}.csv")
    found = cumulative_mixed(
        table, value="score", participant="participant", within=within, item=item, slopes=not item
    ).set_index("effect")
    reference = pd.read_csv(HERE / "crossed_r.csv")
    reference = reference[reference["design"] == name].set_index("what")["value"]
    for effect in found.index:
        assert found.loc[effect, "chi2"] == pytest.approx(reference[f"chi2 {effect}"], abs=2e-5)
        if np.isfinite(found.loc[effect, "spread"]):
            assert found.loc[effect, "spread"] == pytest.approx(reference[f"sd participant:{effect}"], abs=1e-4)
    assert set(found["note"]) == {""}


@pytest.mark.parametrize("crossed", [True, False])
def test_the_gradient_is_exact(crossed):
    rng = np.random.default_rng(0)
    random = RandomEffects(
        person=rng.integers(0, 5, 60),
        own=np.stack([np.zeros(60, int), rng.integers(1, 4, 60)], axis=1),
        value=rng.normal(size=(60, 2)),
        factor=np.array([0, 1, 1, 1]),
        item=rng.integers(0, 7, 60) if crossed else None,
    )
    model = _Likelihood(rng.integers(0, 4, 60), rng.integers(1, 4, 60), rng.normal(size=(60, 2)), random)
    x = np.array([-1.0, 0.2, -0.1, 0.3, -0.5, 0.6, 0.3, *([0.8] if crossed else [])])
    assert model.loss(x)[1] == pytest.approx(approx_fprime(x, lambda z: model.loss(z)[0], 1e-6), abs=1e-4)


def test_only_the_order_of_the_categories_counts():
    table = pd.read_csv(HERE / "four_points_items.csv")
    options = {"value": "score", "participant": "participant", "within": ["object"], "slopes": False}
    plain = cumulative_mixed(table, **options)
    assert cumulative_mixed(table.assign(score=table["score"] ** 3), **options)["chi2"][0] == plain["chi2"][0]


def test_invalid_tables_are_refused():
    table = {"y": [1, 2, 1, 2], "who": [0, 0, 1, 1], "x": [0, 1, 0, 1]}
    options = {"value": "y", "participant": "who", "within": ["x"]}
    with pytest.raises(InputError, match="2 to 30 different answers, got 1"):
        cumulative_mixed(table | {"y": [1] * 4}, **options)
    with pytest.raises(InputError, match="two or more for a mixed model"):
        cumulative_mixed(table | {"who": [0] * 4}, **options)
    with pytest.raises(InputError, match="factor 'x': expected two or more levels"):
        cumulative_mixed(table | {"x": [0] * 4}, **options)
