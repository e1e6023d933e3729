"""Patterns as files of the AdapTics Designer, revision 0.1.0-alpha.3.

One focus moves there at a time: on a circle or a Lissajous curve, the brush, around a centre that key frames move in
straight lines or steps. Its amplitude modulation goes down to silence. Both count from the start of playing.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from midair.errors import InputError
from midair.files import write_file
from midair.patterns.adaptics import REVISIONS, AdapticsPattern
from midair.patterns.pattern import Pattern, Spot
from midair.patterns.shapes import Circle, Lissajous, Points

MOST_KEYS = 2000
"""Largest number of key frames in a file."""


def save_adaptics(
    pattern: Pattern | AdapticsPattern, path: str | os.PathLike[str], duration: float | None = None
) -> float:
    """Write a pattern as an ``.adaptics`` file, and return the pressure of its intensity 1 in Pa.

    A pattern that was read from such a file keeps its key frames, jumps and formulas; the values of its parameters
    become their defaults. `duration` in s is the length of another pattern, one pass if None.

    Raises
    ------
    InputError
        If the format cannot hold the pattern, or a loop has no duration.
    """
    write_file(path, adaptics_text(pattern, duration))
    return pattern.pressure if isinstance(pattern, AdapticsPattern) else _loudest(pattern)


def adaptics_text(pattern: Pattern | AdapticsPattern, duration: float | None = None) -> str:
    """The text of the file that `save_adaptics` writes, with the same errors."""
    if isinstance(pattern, AdapticsPattern):
        return pattern.text
    brushes, centres = zip(*map(_split, pattern.spot), strict=True)
    foci = replace(pattern, spot=centres).foci(duration)
    sounds, frames = foci.pressure > 0, np.arange(foci.frames)
    if (twice := sounds.sum(axis=1) > 1).any():
        when = twice.argmax() / foci.rate
        raise InputError(f"spot: expected one at a time in an .adaptics file, got two at {when:g} s; use stop_s")
    # Silent frames keep the place and the brush.
    last = np.maximum.accumulate(np.where(sounds.any(axis=1), frames, 0))
    spot = sounds.argmax(axis=1)[last]
    rows = np.column_stack([1e3 * foci.position[last, spot], foci.pressure.sum(axis=1) / _loudest(pattern)])
    moves = np.abs(np.diff(rows, axis=0, append=rows[-1:])) > 1e-9
    bends = np.flatnonzero(np.abs(np.diff(rows, n=2, axis=0)).max(axis=1, initial=0) > 1e-10) + 1
    changes = np.flatnonzero(np.diff(spot))
    knots = np.unique(np.concatenate([[0], bends, changes, changes + 1, frames[-1:]])).astype(int)
    # The end of a rest before a jump, which is a step.
    rests = ~moves[knots - 1].any(axis=1) & (np.diff(knots, append=knots[-1] + 1) == 1) & (knots > 0)
    knots = knots[~rests | np.isin(knots, changes + 1)]
    # A corner at a frame bends by less than a nanometre in the frame before, too.
    before, here, after = knots[:-2], knots[1:-1], knots[2:]
    bend = rows[here] - rows[here - 1] - (rows[after] - rows[here])
    flat = (np.abs(bend).max(axis=1) < 1e-6) & (after == here + 1) & (here > before + 1)
    knots = np.delete(knots, 1 + np.flatnonzero(flat & (spot[before] == spot[after])))
    if len(knots) > MOST_KEYS:
        raise InputError(
            f"expected at most {MOST_KEYS} key frames in an .adaptics file, got {len(knots)}; it holds straight lines, "
            "jumps, circles, Lissajous curves and am of depth 1, the last three with whole periods before start_s"
        )
    keys: list[dict[str, Any]] = []
    for here in knots:
        x, y, z, level = np.round(rows[here] - [0, 0, pattern.height_mm, 0], 9).tolist()
        intensity = {"name": "constant", "params": _numbers({"value": level})}
        keys.append(
            {
                "time": round(float(1e3 * here / foci.rate), 9),
                "type": "standard",
                "coords": _timed("coords", {"x": x, "y": y, "z": z}, bool(moves[here, :3].any())),
                "brush": _timed("brush", brushes[spot[here]], False),
                "intensity": _timed("intensity", intensity, bool(moves[here, 3])),
                "cjumps": [],
            }
        )
    content = {
        "$DATA_FORMAT": "MidAirHapticsAnimationFileFormat",
        "$REVISION": REVISIONS[-1],
        "name": pattern.name or "midair",
        "keyframes": [*keys, {"time": round(1e3 * foci.frames / foci.rate, 9), "type": "stop"}],
        "pattern_transform": {
            "geometric_transforms": {
                "translate": _numbers({"x": 0.0, "y": 0.0, "z": pattern.height_mm}),
                "scale": _numbers({"x": 1.0, "y": 1.0, "z": 1.0}),
            }
            | _numbers({"rotation": 0.0}),
        }
        | _numbers({"intensity_factor": 1.0, "playback_speed": 1.0}),
        "user_parameter_definitions": {},
    }
    return json.dumps(content, indent=1)


def _loudest(pattern: Pattern) -> float:
    """Pressure of intensity 1 in Pa."""
    return max(spot.pressure_pa for spot in pattern.spot) or 1.0


def _split(spot: Spot) -> tuple[dict[str, Any], Spot]:
    """The brush of a spot, one of radius 0 if it has no other, and what moves and changes besides."""
    shape, turns, turn, rest = spot.shape, spot.rate(), spot.turn_deg / 360, spot
    if spot.lm and not spot.lm.step_mm and not turns:
        shape, turns, turn, rest = (
            Circle(radius_mm=spot.lm.radius_mm),
            spot.lm.frequency_hz,
            0.0,
            replace(spot, lm=None),
        )
    elif turns and not spot.positions and isinstance(shape, Circle | Lissajous):
        rest = replace(spot, shape=Points(), draw_hz=0.0, speed_m_s=0.0)
    begun, name, own = turns * spot.start_s, "circle", {"radius": 0.0}
    if rest is not spot and isinstance(shape, Circle):
        own = {"radius": shape.radius_mm}
        if not _whole(turn - begun):
            # A circle that begins elsewhere is a Lissajous curve with a rotation, in rad.
            name, own = "lissajous", {"a": 1.0, "b": 1.0, "d": np.pi / 2, "rotation": 2 * np.pi * (turn - begun)}
            own |= {"x_scale": shape.radius_mm, "y_scale": shape.radius_mm}
    elif rest is not spot and isinstance(shape, Lissajous) and _whole(begun):
        name, own = "lissajous", {"a": shape.a, "b": shape.b, "d": np.radians(shape.phase_deg)}
        own |= {"rotation": 2 * np.pi * turn, "x_scale": shape.width_mm / 2, "y_scale": shape.depth_mm / 2}
    else:
        rest, turns = spot, 100.0
    am = spot.am.frequency_hz if spot.am and spot.am.depth == 1 and _whole(spot.am.frequency_hz * spot.start_s) else 0.0
    rest = replace(rest, am=None) if am else rest
    return {"name": name, "params": _numbers(own | {"stm_freq": turns, "am_freq": am})}, rest


def _whole(turns: float) -> bool:
    return abs(turns - round(turns)) < 1e-9


def _timed(name: str, value: Any, linear: bool) -> dict[str, Any]:
    return {name: value, "transition": {"name": "linear" if linear else "step", "params": {}}}


def _numbers(values: Mapping[str, float]) -> dict[str, Any]:
    return {name: {"type": "f64", "value": float(value)} for name, value in values.items()}
