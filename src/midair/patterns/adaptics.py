"""Patterns of the AdapTics Designer, ``.adaptics`` files, evaluated as its own evaluator does.

The files are JSON, "MidAirHapticsAnimationFileFormat", revisions 0.0.10-alpha.1 to 0.1.0-alpha.3 (John, Li & Seifi,
"AdapTics", CHI 2024): key frames of place, brush and intensity, with jumps on conditions, and parameters from which
numbers are computed. Times are in ms and lengths in mm here, as there.
"""

import os
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from math import cos, fmod, inf, isfinite, pi, sin
from operator import add, ge, gt, le, lt, mul, sub, truediv
from typing import Any, NamedTuple

import numpy as np

from midair.errors import BrokenFileError, InputError
from midair.files import check_memory_for, json_of, read_text
from midair.patterns.drawing import Foci

REVISIONS = ("0.0.10-alpha.1", "0.1.0-alpha.2", "0.1.0-alpha.3")
LONGEST = 20.0
"""Longest pattern without a stated duration, in s."""

_EXPECTED = "a pattern of the AdapTics Designer"
MOST_KEYS = 1000
"""Number of key frames above which a pattern is refused: to read and draw them holds up a server."""
_DEEPEST = 50  # nesting of a formula
_OPERATIONS = {"add": add, "subtract": sub, "multiply": mul, "divide": truediv}
_COMPARISONS = {"lt": lt, "lt_eq": le, "gt": gt, "gt_eq": ge}
_BRUSHES = {
    "circle": ("radius",),
    "line": ("length", "thickness", "rotation"),
    "lissajous": ("a", "b", "d", "rotation", "x_scale", "y_scale"),
}
_INTENSITIES = {"constant": ("value",), "random": ("min", "max")}
Values = Mapping[str, float]


class Evaluated(NamedTuple):
    """The point of a pattern at one time; `state` is where the next evaluation goes on."""

    place: tuple[float, float, float]  # in mm; z from the array
    intensity: float
    time: float  # on the pattern's own time line, in ms
    stop: bool
    state: tuple[float, float]  # last time on that time line, and its offset, in ms


@dataclass(frozen=True, slots=True)
class _Timed:
    """A place, the name and numbers of a brush, or both ends of an intensity, as a key frame states them."""

    time: float
    value: tuple[float, ...]
    linear: bool
    name: str = ""


@dataclass(frozen=True, slots=True)
class _Key:
    """A key frame; with what earlier ones state, or later ones, it is what holds before or after a time."""

    time: float = 0.0
    kind: str = ""
    coords: _Timed | None = None
    brush: _Timed | None = None
    intensity: _Timed | None = None
    jump: float | None = None

    def then(self, key: "_Key") -> "_Key":
        coords, brush, intensity = (getattr(key, each) or getattr(self, each) for each in _STATED)
        if key.kind != "standard":
            coords = coords and replace(coords, time=key.time)
        if key.kind == "stop":
            brush, intensity = (each and replace(each, time=key.time) for each in (brush, intensity))
        return _Key(key.time, key.kind, coords, brush, intensity)


_STATED = ("coords", "brush", "intensity")


@dataclass(frozen=True, slots=True, kw_only=True)
class AdapticsPattern:
    """One pattern for given values of its parameters."""

    name: str
    keys: tuple[_Key, ...]
    spans: tuple[tuple[_Key, _Key], ...]
    """Values before and after each time between two key frames."""
    transform: tuple[float, ...]
    """Scales along x, y, z; rotation in deg; translation along x, y, z; intensity factor; playback speed."""
    pressure: float = 50.0
    """Radiation pressure in Pa at intensity 1."""
    rate: float = 4000.0

    def evaluate(self, time: float, state: tuple[float, float] = (0.0, 0.0), *, draw: Any = None) -> Evaluated:
        """The point at `time` in ms of playing, after `state`, which is that of the evaluation before.

        `draw` returns the numbers from 0 to 1 of random intensities, by default .5.
        """
        x_scale, y_scale, z_scale, degrees, x_to, y_to, z_to, factor, speed = self.transform
        last, offset = state
        passed = time + offset - last
        offset = offset + speed * passed - passed
        now = time + offset
        first, end = (bisect_right(self.keys, at, key=lambda key: key.time) for at in (last, now))
        jumps = (key.jump for key in self.keys[first:end] if key.jump is not None)
        if (jump := next(jumps, None)) is not None:
            last, offset = jump, jump - time
            now = time + offset
        else:
            last = now
        before, after = self.spans[bisect_right(self.keys, now, key=lambda key: key.time)]
        x, y, z = _mixed(now, before.coords, after.coords if after.kind == "standard" else None, (0.0, 0.0, 0.0))
        (level,) = _mixed(now, _drawn(before.intensity, draw), _drawn(after.intensity, draw), (0.0,))
        x, y, turn = x * x_scale, y * y_scale, degrees / 180 * pi
        x, y = x * cos(turn) - y * sin(turn), x * sin(turn) + y * cos(turn)
        dx, dy, am = _brushed(time, now, before.brush, after.brush)
        place = (x + x_to + dx, y + y_to + dy, z * z_scale + z_to)
        return Evaluated(place, factor * level * am, now, before.kind == "stop", (last, offset))

    def foci(self, duration: float | None = None) -> Foci:
        """The foci of every frame until the pattern ends, or for `duration` in s at most.

        Raises InputError for a pattern that does not end within `LONGEST` without a duration.
        """
        draw = np.random.default_rng(0).random
        points: list[Evaluated] = []
        state, end = (0.0, 0.0), max((key.time for key in self.keys), default=0.0)
        most = (duration or LONGEST) * self.rate
        check_memory_for(1e3 * most, f"{self.name}: {duration:g} s" if duration else self.name, "make it shorter")
        for frame in range(round(most)):
            point = self.evaluate(1e3 * frame / self.rate, state, draw=draw)
            if point.stop or point.time > end:
                break
            points.append(point)
            state = point.state
        else:
            if duration is None:
                raise InputError(f"{self.name}: expected a pattern that ends within {LONGEST:g} s; give --duration")
        if not points:
            raise InputError(f"{self.name}: expected a pattern longer than one frame, got one that ends at once")
        position = 1e-3 * np.array([point.place for point in points])[:, None]
        pressure = self.pressure * np.clip([[point.intensity] for point in points], 0, 1)
        return Foci(position=position, pressure=pressure, rate=self.rate, height=1e-3 * self.transform[6])


def _mixed(now: float, before: _Timed | None, after: _Timed | None, none: Sequence[float]) -> Sequence[float]:
    """The value between two times; that before if there is none after."""
    if before is None or after is None:
        return none if before is None else before.value
    share = (now - before.time) / (after.time - before.time)
    p, n = (1.0 - share, share) if before.linear else ((1.0, 0.0) if share < 1 else (0.0, 1.0))
    return [p * x + n * y for x, y in zip(before.value, after.value, strict=True)]


def _drawn(level: _Timed | None, draw: Any) -> _Timed | None:
    if level is None or len(level.value) == 1:
        return level
    least, most = level.value
    return replace(level, value=((draw() if draw else 0.5) * (most - least) + least,))


def _brushed(time: float, now: float, before: _Timed | None, after: _Timed | None) -> tuple[float, float, float]:
    """Way of the brush from its centre in mm, and the factor of its amplitude modulation."""
    if before is None:
        return 0.0, 0.0, 1.0
    # The curve is that of the key frame before; rotation, scales and modulation are interpolated.
    high, wide, a, b, d, rate = before.value[4:]
    turn, x_scale, y_scale, am, *_ = _mixed(now, before, after if after and after.name == before.name else None, ())
    t = fmod(time / 1000 * rate * 2 * pi, 2 * pi)
    x, y = high * sin(a * t + d) * x_scale, wide * sin(b * t) * y_scale
    factor = cos(am * (time / 1000) * 2 * pi) * 0.5 + 0.5
    return (x * cos(turn) - y * sin(turn)) * 1000, (x * sin(turn) + y * cos(turn)) * 1000, factor


def load_adaptics(path: str | os.PathLike[str], values: Values, *, pressure: float = 50.0) -> AdapticsPattern:
    """Read an ``.adaptics`` file; `values` are those of parameters that differ from their defaults.

    Raises MissingFileError, or BrokenFileError if the file is no pattern; InputError if it has no such parameter.
    """
    return read_adaptics(read_text(path, _EXPECTED), values, pressure=pressure, source=path, others=False)


def read_adaptics(
    text: str, values: Values, *, pressure: float = 50.0, source: object = "pattern", others: bool = True
) -> AdapticsPattern:
    """Read the text of an ``.adaptics`` file, named `source` in errors; `others` allows unknown parameters.

    Raises BrokenFileError and InputError as `load_adaptics` does.
    """
    try:
        content = json_of(text)
        if not others:
            check_parameters(values, content["user_parameter_definitions"])
        return _pattern_of(content, values, pressure)
    except InputError as wrong:
        raise InputError(f"{source}: {wrong}") from wrong
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError) as wrong:
        raise BrokenFileError(f"{source}: expected {_EXPECTED}, got: {type(wrong).__name__} {wrong}") from wrong


def _pattern_of(content: Any, values: Values, pressure: float) -> AdapticsPattern:
    if content["$DATA_FORMAT"] != "MidAirHapticsAnimationFileFormat" or content["$REVISION"] not in REVISIONS:
        raise ValueError(f"revision {content['$REVISION']!r}; known are {', '.join(REVISIONS)}")
    check_count(len(content["keyframes"]), MOST_KEYS, "keyframes")
    chosen, known = dict(values), content["user_parameter_definitions"]
    for name, one in known.items():
        least, most = (far if one.get(end) is None else _finite(one[end]) for end, far in (("min", -inf), ("max", inf)))
        chosen[name] = min(max(values.get(name, _finite(one["default"])), least), most)
    keys = tuple(sorted((_key(one, chosen) for one in content["keyframes"]), key=lambda key: key.time))
    before = accumulate(keys, _Key.then, initial=_Key())
    after = list(accumulate(reversed(keys), _Key.then, initial=_Key()))
    whole = content["pattern_transform"]
    moved = whole["geometric_transforms"]
    numbers = [*(moved["scale"][axis] for axis in "xyz"), moved["rotation"]]
    numbers += [*(moved["translate"][axis] for axis in "xyz"), whole["intensity_factor"], whole["playback_speed"]]
    spans, transform = zip(before, reversed(after), strict=True), (_number(each, chosen) for each in numbers)
    name = str(content["name"])
    return AdapticsPattern(name=name, keys=keys, spans=tuple(spans), transform=tuple(transform), pressure=pressure)


def check_count(count: int, most: int, name: str) -> None:
    """Raise InputError if a pattern has more parts of a name than can be drawn in time."""
    if count > most:
        raise InputError(f"{name}: expected at most {most} in a pattern, got {count}; make several patterns of it")


def check_parameters(given: Values, known: Mapping[str, Any]) -> None:
    """Raise InputError for a value of a parameter that is not known."""
    if unknown := sorted(set(given) - set(known)):
        raise InputError(f"parameter: expected one of {', '.join(known) or 'none'}, got {', '.join(unknown)}")


def _finite(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"{value!r} in place of a finite number")
    return float(value)


def _key(one: Any, values: Values) -> _Key:
    kind, time = one["type"], _finite(one["time"])
    if kind == "stop":
        return _Key(time, kind)
    stated: dict[str, _Timed] = {}
    for name in _STATED if {"standard": True, "pause": False}[kind] else _STATED[1:]:
        if (table := one["coords"] if name == "coords" else one.get(name)) is None:
            continue
        inner, linear = table[name], {"linear": True, "step": False}[table["transition"]["name"]]
        if name == "coords":
            stated[name] = _Timed(time, tuple(_finite(inner[axis]) for axis in "xyz"), linear)
            continue
        names, given = (_BRUSHES if name == "brush" else _INTENSITIES)[inner["name"]], inner["params"]
        own = tuple(_number(given[each], values) for each in names)
        if name == "brush":
            rate = _number(given.setdefault("stm_freq", {"type": "f64", "value": 100.0}), values)
            own = _brush(inner["name"], own, _number(given["am_freq"], values), rate)
        stated[name] = _Timed(time, own, linear, inner["name"])
    jump: float | None = None
    for each in reversed(one["cjumps"]):
        asked, to = each["condition"], _finite(each["jump_to"])
        holds = _COMPARISONS[asked["operator"]["name"]]
        if asked["parameter"] in values and holds(values[asked["parameter"]], _finite(asked["value"])):
            jump = to
    return _Key(time, kind, **stated, jump=jump)


def _brush(name: str, own: Sequence[float], am: float, rate: float) -> tuple[float, ...]:
    """Rotation, two scales and AM; then A, B, a, b, d and draw rate of x = A sin(a t + d), y = B sin(b t), in m."""
    if name == "circle":
        return (0.0, own[0] / 1000, own[0] / 1000, am, 1.0, 1.0, 1.0, 1.0, pi / 2, rate)
    if name == "line":
        return (own[2] * (pi / 180), own[0] / 1000, own[1] / 1000, am, 1.0, 0.0, 1.0, 1.0, pi / 2, rate)
    a, b, d, turn, wide, deep = own
    # Unlike that of a line, the evaluator takes this rotation in rad.
    return (turn, 1.0, 1.0, am, wide / 1000, deep / 1000, a, b, d, rate)


def _number(table: Any, values: Values) -> float:
    """A number: a constant, a parameter or a formula of both; 0 for a parameter that is not defined."""
    if table["type"] == "dynamic":
        table["type"] = "param"  # as it is called since 0.1.0
    kind, value = table["type"], table["value"]
    if kind == "f64":
        return _finite(value)
    return _finite(_formula(value, values) if kind == "formula" else {"param": values}[kind].get(value, 0.0))


def _formula(table: Any, values: Values, depth: int = 0) -> float:
    kind, value = table["type"], table["value"]
    if depth > _DEEPEST:
        raise ValueError(f"a formula that is nested more than {_DEEPEST} times")
    if kind == "constant":
        return _finite(value)
    if kind == "parameter":
        return values.get(value, 0.0)
    if kind == "negate":
        return -_formula(value, values, depth + 1)
    left, right = (_formula(each, values, depth + 1) for each in value)
    return _OPERATIONS[kind](left, right)
