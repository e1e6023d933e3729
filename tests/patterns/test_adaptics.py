"""AdapTics files against the public evaluator of their makers, and against hand-made faults.

With node, and MIDAIR_ADAPTICS the folder of the npm package adaptics-pattern-evaluator 0.7.0-alpha.1, every point of
the examples and of random files is compared; `python -m benchmarks.adaptics` compares more.
"""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from benchmarks.adaptics import EXAMPLES, HERE, compared, evaluated

from midair.errors import BrokenFileError, InputError
from midair.patterns import load_adaptics

PACKAGE = os.environ.get("MIDAIR_ADAPTICS", "")


@pytest.mark.skipif(not (PACKAGE and shutil.which("node")), reason="needs node and MIDAIR_ADAPTICS")
def test_every_point_is_the_evaluator_s():
    count, worst = compared(Path(PACKAGE), 200)
    assert (count, worst < 1e-9) == (215, True)


KNOWN = {
    "Button": [
        (5.0, 0.0, 200.0, 0.7, 120.0, 0.0),
        (-2.408768371, 4.3815334, 200.0, 0.7, 0.0, 0.0),
        (5.0, -2.143874675e-13, 200.0, 0.7, 0.0, 0.0),
    ],
    "Rain": [
        (57.5, -20.0, 200.0, 0.0, 228.0, 0.0),
        (-48.13191464, 33.88686406, 200.0, 0.4448666667, 633.27, 0.0),
        (27.925, -45.0, 200.0, 0.65, 2470.0, 0.0),
    ],
    "circle-grow": [
        (16.17142857, 0.0, 200.0, 1.0, 120.0, 0.0),
        (-13.07534529, 23.78396479, 200.0, 1.0, 333.3, 0.0),
        (76.85714286, -3.295441644e-12, 200.0, 1.0, 1300.0, 0.0),
    ],
}
"""x, y, z, intensity, time and stop by adaptics-pattern-evaluator 0.7.0-alpha.1, all parameters 0.7."""


def test_points_that_the_evaluator_gave():
    for path in EXAMPLES:
        values = dict.fromkeys(json.loads(path.read_text(encoding="utf-8"))["user_parameter_definitions"], 0.7)
        _, points = evaluated(path.read_text(encoding="utf-8"), values, [120.0, 333.3, 1300.0])
        assert points == pytest.approx(np.array(KNOWN[path.stem]), rel=1e-9, abs=1e-9), path


def changed(change):
    content = json.loads((HERE / "Rain.adaptics").read_text(encoding="utf-8"))
    change(content)
    return json.dumps(content)


def deep(content):
    one = {"type": "constant", "value": 1}
    for _ in range(200):
        one = {"type": "negate", "value": one}
    content["pattern_transform"]["intensity_factor"] = {"type": "formula", "value": one}


FAULTS = {
    "revision '9'": lambda content: content.update({"$REVISION": "9"}),
    "KeyError 'keyframes'": lambda content: content.pop("keyframes"),
    "nan in place of a finite number": lambda content: content["keyframes"][0].update(time=float("nan")),
    "'x' in place of a finite number": lambda content: content["keyframes"][0].update(time="x"),
    "KeyError 'square'": lambda content: content["keyframes"][0]["brush"]["brush"].update(name="square"),
    "TypeError": lambda content: content.update(keyframes=3),
    "nested more than 50 times": deep,
}


def test_broken_and_other_files_and_other_parameters_are_refused_in_one_line(tmp_path, subtests):
    others = [("", text) for text in ("", "[1]", "{", "null", '{"a": 1}')]
    path = tmp_path / "x.adaptics"
    for said, text in [*((said, changed(change)) for said, change in FAULTS.items()), *others]:
        with subtests.test(said=said, text=text[:9]):
            path.write_text(text, encoding="utf-8")
            with pytest.raises(BrokenFileError, match="expected a pattern of the AdapTics Designer") as wrong:
                load_adaptics(path, {})
            assert said in str(wrong.value)
    with pytest.raises(InputError, match=r"expected one of .*droplet_strength.*, got size"):
        load_adaptics(HERE / "Rain.adaptics", {"size": 1.0})


def test_a_pattern_with_too_many_parts_is_refused_before_they_are_read(tmp_path):
    """Before, 20,000 key frames took seconds to read, and no time that anybody waited to draw."""
    path = tmp_path / "x.adaptics"
    path.write_text(changed(lambda content: content.update(keyframes=1001 * [None])), encoding="utf-8")
    with pytest.raises(InputError, match=r"x\.adaptics: keyframes: expected at most 1000 in a pattern, got 1001"):
        load_adaptics(path, {})


@pytest.mark.long
def test_a_pattern_becomes_foci_until_its_stop_key_frame():
    foci = load_adaptics(HERE / "Button.adaptics", {"proximity": 1.0, "activation": 1.0}, pressure=80.0).foci()
    assert (foci.frames, foci.rate, foci.height) == (5000, 4000.0, 0.2)  # it stops at 1.25 s
    assert foci.pressure.max() == pytest.approx(80)
    assert foci.position[:, 0, 2] == pytest.approx(0.2)
    waiting = load_adaptics(HERE / "Button.adaptics", {})
    assert waiting.foci(0.5).frames == 2000
    with pytest.raises(InputError, match="expected a pattern that ends within 20 s; give --duration"):
        waiting.foci()
