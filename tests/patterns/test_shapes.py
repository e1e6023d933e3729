import tomllib

import numpy as np
import pytest
import tomli_w

from midair.errors import InputError
from midair.files import to_plain
from midair.patterns import SHAPES, AmplitudeModulation, LateralModulation, Pattern, Spot
from midair.patterns.shapes import Arc, Circle, Lissajous, Polygon, Svg

SHARE = np.linspace(0, 1, 401)


def test_keys_move_a_spot_and_change_its_pressure():
    keys = [{"at_s": 0.0, "ease": "smooth"}, {"at_s": 0.5, "centre_mm": [20.0, 0.0], "ease": "step"}]
    keys += [{"at_s": 1.0, "centre_mm": [0.0, 10.0], "part": 0.5}]
    spot = {"pressure_pa": 40.0, "key": keys, "start_s": 0.2, "centre_mm": [1.0, 0.0]}
    for loop, at_the_end in ((False, (1.0, 10.0, 20.0)), (True, (21.0, 0.0, 40.0))):
        foci = Pattern.from_plain({"duration_s": 3.0, "spot": [spot | {"loop_keys": loop}]}).foci()
        x, y = 1e3 * foci.position[:, 0, :2].T
        at = (4000 * (0.2 + np.array([0.0, 0.125, 0.25, 0.4999, 0.5, 0.9]))).astype(int)
        # 3 s^2 - 2 s^3 of a quarter and a half of the way.
        np.testing.assert_allclose(x[at], [1, 1 + 20 * 0.15625, 11, 21, 21, 21], atol=0.05)
        assert foci.pressure[int(4000 * 1.1), 0] == 40
        np.testing.assert_allclose((x[-801], y[-801], foci.pressure[-801, 0]), at_the_end, atol=0.05)


def test_every_shape_goes_through_its_file_and_ends_where_it_says(subtests):
    for name in SHAPES:
        with subtests.test(name=name):
            shape = SHAPES[name]()
            pattern = Pattern(spot=(Spot(shape=shape, am=AmplitudeModulation(), lm=LateralModulation()),), name="x")
            plain = to_plain(pattern)
            plain["spot"][0]["shape"]["name"] = name
            assert Pattern.from_plain(tomllib.loads(tomli_w.dumps(plain))) == pattern
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
    ring = Svg(path="M2 1A1 1 0 0 0 0 1A1 1 0 0 0 2 1", size_mm=20.0)
    assert ring.at(SHARE) == pytest.approx(Circle(radius_mm=10.0).at(SHARE), abs=0.02), "y of an SVG points down"
    with pytest.raises(InputError, match=r"got: .{,80}$"):
        Svg(path="<svg>" * 999)
    hook = Svg(path="m0 0h4v-2", size_mm=40.0).at(np.array([0, 1 / 3, 0.5, 2 / 3, 1]))
    assert hook == pytest.approx(np.array([[-20, -10], [20, -10], [20, 10], [20, -10], [-20, -10]])), "there and back"
    apart = Svg(path="M0 0H1M3 0H4", size_mm=40.0).at(np.array([0.25, 0.49, 0.51, 1]))[:, 0]
    assert apart == pytest.approx([-15, -10.2, 10.2, 20]), "the jump takes no time"


PARAMETERS = {
    "parameters": {"size": {"default": 12.0, "min": 5.0, "max": 20.0}},
    "spot": [{"shape": {"name": "circle", "radius_mm": "$size"}, "pressure_pa": 30.0}],
}


def test_a_parameter_stands_for_a_number_within_its_range():
    assert Pattern.from_plain(PARAMETERS).spot[0].shape == Circle(radius_mm=12.0)
    assert Pattern.from_plain(PARAMETERS, {"size": 20.0}).spot[0].shape == Circle(radius_mm=20.0)
