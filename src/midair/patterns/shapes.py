"""Shapes that a focus moves along, one class and one entry of `SHAPES` each.

A shape is a frozen dataclass whose fields are the keys of its table in a pattern's file; lengths in mm, angles in deg.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import ClassVar

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.validation import check_settings, setting

_SPAN = (0, 500)
"""Least and largest length in mm."""


class Checked:
    """Base of frozen dataclasses whose fields have limits."""

    def __post_init__(self) -> None:
        check_settings(self)


class Shape(Checked, ABC):
    """A path in the plane of the palm, around the centre of its spot."""

    closed: ClassVar[bool] = True
    """Whether its end is its beginning; an open path is drawn there and back."""

    def at(self, share: Array) -> Array:
        """Places at shares of the path, 0 to 1, shape (frame,); the result has the shape (frame, 2), in mm."""
        return self._at(share)

    @abstractmethod
    def _at(self, share: Array) -> Array: ...

    def length(self) -> float:
        """Length of the path in mm."""
        return float(np.linalg.norm(np.diff(self.at(np.linspace(0, 1, 3601)), axis=0), axis=1).sum())


def on_circle(radius: float, turns: Array) -> Array:
    """Places on a circle after some turns from the x axis, shape (frame, 2)."""
    angle = 2 * np.pi * turns
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _corners(value: object, least: int, name: str) -> Array:
    corners = np.array(value, float).reshape(-1, 2)
    if len(corners) < least or not np.isfinite(corners).all() or np.abs(corners).max(initial=0) > _SPAN[1]:
        raise InputError(f"{name}: expected {least} or more places [x, y] of up to {_SPAN[1]} mm, got {value}")
    return corners


@dataclass(frozen=True, slots=True, kw_only=True)
class Points(Shape):
    """Places that the focus jumps to in turn, each for the same time."""

    places_mm: tuple[tuple[float, float], ...] = ((0.0, 0.0),)

    def __post_init__(self) -> None:
        _corners(self.places_mm, 1, "places_mm")

    def _at(self, share: Array) -> Array:
        places = _corners(self.places_mm, 1, "places_mm")
        return places[np.minimum((share * len(places) + 1e-9).astype(int), len(places) - 1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle(Shape):
    """A circle from the x axis on, counter-clockwise."""

    radius_mm: float = setting(15.0, "Radius.", unit="mm", limits=_SPAN, above=True)

    def _at(self, share: Array) -> Array:
        return on_circle(self.radius_mm, share)


@dataclass(frozen=True, slots=True, kw_only=True)
class Arc(Shape):
    """Part of a circle."""

    closed: ClassVar[bool] = False
    radius_mm: float = setting(15.0, "Radius.", unit="mm", limits=_SPAN, above=True)
    from_deg: float = setting(0.0, "Angle at the beginning.", unit="deg", limits=(-720, 720))
    to_deg: float = setting(180.0, "Angle at the end.", unit="deg", limits=(-720, 720))

    def _at(self, share: Array) -> Array:
        return on_circle(self.radius_mm, (self.from_deg + (self.to_deg - self.from_deg) * share) / 360)


@dataclass(frozen=True, slots=True, kw_only=True)
class Line(Shape):
    """A straight line along x; `turn_deg` of the spot rotates it."""

    closed: ClassVar[bool] = False
    length_mm: float = setting(30.0, "Length.", unit="mm", limits=_SPAN, above=True)

    def _at(self, share: Array) -> Array:
        return np.stack([self.length_mm * (share - 0.5), 0 * share], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Polygon(Shape):
    """Straight lines between corners and back to the first, at equal speed."""

    corners_mm: tuple[tuple[float, float], ...] = ((-15.0, -15.0), (15.0, -15.0), (15.0, 15.0), (-15.0, 15.0))

    def __post_init__(self) -> None:
        if len(np.unique(_corners(self.corners_mm, 3, "corners_mm"), axis=0)) < 2:
            raise InputError(f"corners_mm: expected corners that differ, got {self.corners_mm}")

    def _at(self, share: Array) -> Array:
        corners = np.array([*self.corners_mm, self.corners_mm[0]], float)
        way = np.append(0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
        return np.stack([np.interp(share * way[-1], way, axis) for axis in corners.T], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lissajous(Shape):
    """x = width / 2 sin(2 pi a s + phase), y = depth / 2 sin(2 pi b s), with s the share of the path."""

    width_mm: float = setting(30.0, "Width along x.", unit="mm", limits=_SPAN)
    depth_mm: float = setting(30.0, "Depth along y.", unit="mm", limits=_SPAN)
    a: int = setting(3, "Waves along x.", limits=(1, 50))
    b: int = setting(2, "Waves along y.", limits=(1, 50))
    phase_deg: float = setting(90.0, "Phase of x.", unit="deg", limits=(-720, 720))

    def _at(self, share: Array) -> Array:
        x = self.width_mm / 2 * np.sin(2 * np.pi * self.a * share + np.radians(self.phase_deg))
        return np.stack([x, self.depth_mm / 2 * np.sin(2 * np.pi * self.b * share)], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Svg(Shape):
    """The outline of the attribute `d` of an SVG path, centred, at equal speed; an open one is drawn there and back.

    The focus jumps between the parts of a path.
    """

    path: str = setting("M0 0C3-6 9-3 9 2S3 10 0 13C-3 10-9 7-9 2S-3-6 0 0Z", "Commands of the path; y points down.")
    size_mm: float = setting(40.0, "Longer side of its box.", unit="mm", limits=_SPAN, above=True)

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        _outline(self.path)

    def _at(self, share: Array) -> Array:
        places, way = _outline(self.path)
        return self.size_mm * np.stack([np.interp(share * way[-1], way, axis) for axis in places.T], axis=-1)


LONGEST_PATH = 20_000
"""Longest path in characters."""


@lru_cache(16)
def _outline(path: str) -> tuple[Array, Array]:
    """Places of a path, centred, its longer side 1, y up, shape (place, 2), and the length of the way to each."""
    from fontTools.pens.recordingPen import RecordingPen
    from fontTools.svgLib.path import parse_path

    pen, parts, s = RecordingPen(), list[list[Array]](), np.linspace(0, 1, 33)[1:, None]
    try:
        if not 0 < len(path.strip()) <= LONGEST_PATH:
            raise ValueError(f"{len(path.strip())} characters")
        parse_path(path, pen)
        for command, points in pen.value:
            if command == "moveTo":
                parts.append([np.array(points)])
            elif points:
                # Bezier curve of one to three points, of which the last one is its end.
                curve, order = [parts[-1][-1][-1], *points], len(points)
                if not np.abs(curve).max() <= 1e6:
                    raise ValueError("a number beyond a million")
                weights = [comb(order, k) * s**k * (1 - s) ** (order - k) for k in range(order + 1)]
                parts[-1].append(np.hstack(weights) @ np.array(curve))
        places = [np.concatenate(part) for part in parts]
        low, high = (edge(np.concatenate(places), axis=0) for edge in (np.min, np.max))
        if not (size := (high - low).max()) > 0:
            raise ValueError("a path without length")
    except (ValueError, IndexError, ArithmeticError) as wrong:
        raise InputError(
            f"path: expected the d of an SVG path of up to {LONGEST_PATH} characters, M0 0L10 5 say, got: {wrong!s:.80}"
        ) from wrong
    if len(places) == 1 and not np.allclose(places[0][0], places[0][-1], atol=1e-6 * size):
        places = [np.concatenate([places[0], places[0][-2::-1]])]
    steps = [np.append(0, np.linalg.norm(np.diff(part, axis=0), axis=1)) for part in places]
    return (np.concatenate(places) - (low + high) / 2) / [size, -size], np.cumsum(np.concatenate(steps) / size)


SHAPES: dict[str, type[Shape]] = {
    kind.__name__.lower(): kind for kind in (Points, Circle, Arc, Line, Polygon, Lissajous, Svg)
}
"""Shapes by the name that a pattern's file gives them."""
