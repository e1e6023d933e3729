"""AdapTics files against the public evaluator of their makers, and against hand-made faults.

With node, and MIDAIR_ADAPTICS the folder of the npm package adaptics-pattern-evaluator 0.7.0-alpha.1, every point of
the examples and of random files is compared; MIDAIR_ADAPTICS_FILES is the number of random files.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from midair.errors import BrokenFileError, InputError
from midair.patterns import load_adaptics

HERE = Path(__file__).parent / "adaptics"
EXAMPLES = sorted(HERE.glob("*.adaptics"))
PACKAGE = os.environ.get("MIDAIR_ADAPTICS", "")


def evaluated(path, values, times):
    pattern, state, points = load_adaptics(path, values), (0.0, 0.0), []
    for time in times:
        point = pattern.evaluate(time, state)
        state = point.state
        points.append([*point.place, point.intensity, point.time, float(point.stop)])
    return np.array(points)


class Writer:
    """Random files of every revision, brush, transition, jump and formula."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.names = [f"p{number}" for number in range(self.rng.integers(0, 4))]

    def one(self, *choices):
        return choices[self.rng.integers(len(choices))]

    def within(self, low, high):
        return float(self.rng.uniform(low, high))

    def formula(self, depth=0):
        kind = self.one(
            "constant", "parameter", *([] if depth > 4 else ["negate", "divide", "add", "subtract", "multiply"])
        )
        if kind == "constant":
            return {"type": kind, "value": self.within(0.5, 3)}
        if kind == "parameter":
            return {"type": kind, "value": self.one(*self.names, "nobody")}
        if kind == "negate":
            return {"type": kind, "value": self.formula(depth + 1)}
        right = {"type": "constant", "value": self.within(0.5, 3)} if kind == "divide" else self.formula(depth + 1)
        return {"type": kind, "value": [self.formula(depth + 1), right]}

    def number(self, low, high):
        kind = self.one("f64", "param", "dynamic", "formula")
        made = {"f64": lambda: self.within(low, high), "formula": self.formula}.get(
            kind, lambda: self.one(*self.names, "nobody")
        )
        return {"type": kind, "value": made()}

    def timed(self, **stated):
        return stated | {"transition": {"name": self.one("linear", "step"), "params": {}}}

    def brush(self):
        kind = self.one("circle", "line", "lissajous")
        names = {"circle": ["radius"], "line": ["length", "thickness", "rotation"]}
        known = names.get(kind, ["a", "b", "d", "rotation", "x_scale", "y_scale"])
        params = {name: self.number(0, 30) for name in [*known, "am_freq", *self.one(["stm_freq"], [])]}
        return self.timed(brush={"name": kind, "params": params})

    def jump(self, time):
        condition = {"parameter": self.one(*self.names, "nobody"), "value": self.within(-1, 2)}
        condition["operator"] = {"name": self.one("lt", "lt_eq", "gt", "gt_eq"), "params": {}}
        return {"condition": condition, "jump_to": self.one(0.0, time / 2, time + 50)}

    def key(self, time):
        kind = self.one("standard", "standard", "pause", "stop")
        made = {"time": time, "type": kind}
        if kind == "stop":
            return made
        if self.rng.random() < 0.8:
            made["brush"] = self.brush()
        if self.rng.random() < 0.8:
            level = {"name": "constant", "params": {"value": self.number(0, 2)}}
            made["intensity"] = self.timed(intensity=level)
        if kind == "standard":
            made["coords"] = self.timed(coords={axis: self.within(-80, 80) for axis in "xyz"})
        return made | {"cjumps": [self.jump(time) for _ in range(self.rng.integers(0, 3))]}

    def file(self):
        limits = {name: {"default": self.within(-1, 3), "step": 0.1} for name in self.names}
        for one in limits.values():
            one |= self.one({}, {"min": self.within(-2, 0)}, {"max": self.within(0.5, 3), "min": None})
        axes = {
            name: {axis: self.number(*span) for axis in "xyz"}
            for name, span in (("translate", (-20, 200)), ("scale", (-2, 2)))
        }
        return {
            "$DATA_FORMAT": "MidAirHapticsAnimationFileFormat",
            "$REVISION": self.one("0.0.10-alpha.1", "0.1.0-alpha.2", "0.1.0-alpha.3"),
            "name": "random",
            "keyframes": [self.key(self.within(0, 1000)) for _ in range(self.rng.integers(0, 9))],
            "pattern_transform": {
                "geometric_transforms": axes | {"rotation": self.number(-180, 180)},
                "intensity_factor": self.number(0, 2),
                "playback_speed": {"type": "f64", "value": self.within(0.2, 3)},
            },
            "user_parameter_definitions": limits,
        }


def case(content, seed):
    rng = np.random.default_rng(seed)
    values = {name: float(rng.uniform(-2, 3)) for name in content["user_parameter_definitions"]}
    return {"pattern": content, "user_parameters": values, "times": np.cumsum(rng.uniform(0, 40, 100)).tolist()}


@pytest.mark.skipif(not (PACKAGE and shutil.which("node")), reason="needs node and MIDAIR_ADAPTICS")
def test_every_point_is_the_evaluator_s(tmp_path):
    read = [json.loads(path.read_text(encoding="utf-8")) for path in EXAMPLES]
    count = int(os.environ.get("MIDAIR_ADAPTICS_FILES", "200"))
    cases = [case(content, seed) for seed in range(5) for content in read]
    cases += [case(Writer(seed).file(), seed) for seed in range(count)]
    (tmp_path / "cases.json").write_text(json.dumps(cases), encoding="utf-8")
    command = ["node", HERE / "evaluate.mjs", Path(PACKAGE).resolve(), tmp_path / "cases.json"]
    theirs = json.loads(subprocess.run(command, capture_output=True, check=True).stdout)
    worst = 0.0
    for one, points in zip(cases, theirs, strict=True):
        (tmp_path / "one.adaptics").write_text(json.dumps(one["pattern"]), encoding="utf-8")
        ours = evaluated(tmp_path / "one.adaptics", one["user_parameters"], one["times"])
        worst = max(worst, (np.abs(ours - points) / np.maximum(1, np.abs(ours))).max())
    print(f"{len(cases)} files, largest difference {worst:.2g}")
    assert worst < 1e-9


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


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_points_that_the_evaluator_gave(path):
    values = dict.fromkeys(json.loads(path.read_text(encoding="utf-8"))["user_parameter_definitions"], 0.7)
    assert evaluated(path, values, [120.0, 333.3, 1300.0]) == pytest.approx(
        np.array(KNOWN[path.stem]), rel=1e-9, abs=1e-9
    )


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


@pytest.mark.parametrize("said", FAULTS)
def test_a_broken_file_is_one_line(said, tmp_path):
    path = tmp_path / "x.adaptics"
    path.write_text(changed(FAULTS[said]), encoding="utf-8")
    with pytest.raises(BrokenFileError, match="expected a pattern of the AdapTics Designer") as wrong:
        load_adaptics(path, {})
    assert said in str(wrong.value)


def test_other_files_and_other_parameters_are_refused(tmp_path):
    for text in ("", "[1]", "{", "null", '{"a": 1}'):
        (tmp_path / "x.adaptics").write_text(text, encoding="utf-8")
        with pytest.raises(BrokenFileError, match="expected a pattern of the AdapTics Designer"):
            load_adaptics(tmp_path / "x.adaptics", {})
    with pytest.raises(InputError, match=r"expected one of .*droplet_strength.*, got size"):
        load_adaptics(HERE / "Rain.adaptics", {"size": 1.0})


def test_a_pattern_becomes_foci_until_its_stop_key_frame():
    foci = load_adaptics(HERE / "Button.adaptics", {"proximity": 1.0, "activation": 1.0}, pressure=80.0).foci()
    assert (foci.frames, foci.rate, foci.height) == (5000, 4000.0, 0.2)  # it stops at 1.25 s
    assert foci.pressure.max() == pytest.approx(80)
    assert foci.position[:, 0, 2] == pytest.approx(0.2)
    waiting = load_adaptics(HERE / "Button.adaptics", {})
    assert waiting.foci(0.5).frames == 2000
    with pytest.raises(InputError, match="expected a pattern that ends within 20 s; give --duration"):
        waiting.foci()
