import tomllib

import numpy as np
import pytest
import tomli_w

from midair.errors import InputError
from midair.patterns import SHAPES, AmplitudeModulation, LateralModulation, Pattern, Spot
from midair.patterns.shapes import Arc, Circle, Lissajous, Polygon

SHARE = np.linspace(0, 1, 401)


@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_goes_through_its_file_and_ends_where_it_says(name):
    shape = SHAPES[name]()
    pattern = Pattern(spot=(Spot(shape=shape, am=AmplitudeModulation(), lm=LateralModulation()),), name="x")
    assert Pattern.from_plain(tomllib.loads(tomli_w.dumps(pattern.plain()))) == pattern
    places = shape.at(SHARE)
    assert places.shape == (401, 2)
    assert np.isfinite(places).all()
    if name != "points":
        assert np.allclose(places[0], places[-1]) == shape.closed
    with pytest.raises(InputError, match=r"spot 1: shape\.wrong: expected"):
        Pattern.from_plain({"spot": [{"shape": {"name": name, "wrong": 1}}]})


def test_closed_forms():
    assert Circle(radius_mm=10.0).length() == pytest.approx(2 * np.pi * 10, rel=1e-5)
    assert Arc(radius_mm=10.0, from_deg=0.0, to_deg=90.0).at(np.array([1.0]))[0] == pytest.approx([0, 10])
    square = Polygon()
    assert square.length() == pytest.approx(120)
    assert square.at(np.array([0, 0.125, 0.25, 0.75])).tolist() == [[-15, -15], [0, -15], [15, -15], [-15, 15]]
    eight = Lissajous(width_mm=20.0, depth_mm=10.0, a=1, b=2, phase_deg=0.0).at(SHARE)
    assert eight[:, 0] == pytest.approx(10 * np.sin(2 * np.pi * SHARE))
    assert eight[:, 1] == pytest.approx(5 * np.sin(4 * np.pi * SHARE))
