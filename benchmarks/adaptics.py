"""AdapTics files: midair's points beside those of the makers' public evaluator, on examples and on random files.

Each file is also read, written and evaluated again, and random patterns of midair are written and evaluated.
It needs node and the npm package adaptics-pattern-evaluator 0.7.0-alpha.1, in a folder that is named.
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from midair.patterns import (
    read_adaptics,
)

HERE = Path(__file__).parents[1] / "tests" / "patterns" / "adaptics"
EXAMPLES = sorted(HERE.glob("*.adaptics"))


def evaluated(text, values, times):
    pattern, state, points = read_adaptics(text, values), (0.0, 0.0), []
    for time in times:
        point = pattern.evaluate(time, state)
        state = point.state
        points.append([*point.place, point.intensity, point.time, float(point.stop)])
    return pattern, np.array(points)


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


def in_evaluator(package, cases):
    """x, y, z, intensity, time and stop of every case by the public evaluator."""
    with tempfile.TemporaryDirectory() as name:
        listed = Path(name, "cases.json")
        listed.write_text(json.dumps(cases), encoding="utf-8")
        command = ["node", HERE / "evaluate.mjs", package.resolve(), listed]
        return json.loads(subprocess.run(command, capture_output=True, check=True).stdout)


def compared(package: Path, count: int) -> tuple[int, float]:
    """Number of files, and the largest difference of a place, an intensity, a time or a stop."""
    read = [json.loads(path.read_text(encoding="utf-8")) for path in EXAMPLES]
    cases = [case(content, seed) for seed in range(5) for content in read]
    cases += [case(Writer(seed).file(), seed) for seed in range(count)]
    worst = 0.0
    ours = [evaluated(json.dumps(one["pattern"]), one["user_parameters"], one["times"]) for one in cases]
    for (_, mine), points in zip(ours, in_evaluator(package, cases), strict=True):
        worst = max(worst, (np.abs(mine - points) / np.maximum(1, np.abs(mine))).max())
    return len(cases), worst


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.adaptics", description=__doc__.splitlines()[0])
    parser.add_argument("package", type=Path, help="folder of the npm package")
    parser.add_argument("--files", type=int, default=10_000, help="number of random files (default 10000)")
    options = parser.parse_args()
    print("{} files, largest difference {:.2g}".format(*compared(options.package, options.files)))


if __name__ == "__main__":
    main()
