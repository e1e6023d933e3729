"""Small pictures of nouns for notebooks: SVG text, made from a few hundred numbers, that any browser draws."""

from html import escape

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WIDTH, HEIGHT = 360, 120
POINTS = 240
"""A line is drawn through so many points at most."""
DOTS = 1000
"""So many dots at most: the transducers of four AUTD3 units."""


def captioned(drawing: str, caption: str) -> str:
    """A drawing and the line below it, as HTML; the caption is escaped here, the drawing is not."""
    return f'<figure style="margin:0">{drawing}<figcaption>{escape(caption)}</figcaption></figure>'


def lines(rows: Array, *, low: str, high: str) -> str:
    """Lines over one axis, all on one scale.

    Parameters
    ----------
    rows : ndarray, shape (line, point)
        Drawn from left to right; only the lowest and highest of each stretch is kept where there are many points.
    low, high : str
        What stands at the left and the right end of the axis.
    """
    rows = np.asarray(rows, float)
    rows = np.where(np.isfinite(rows), rows, 0.0)
    bottom, top = float(rows.min(initial=0.0)), float(rows.max(initial=0.0))
    scale = HEIGHT / (top - bottom) if top > bottom else 0.0
    drawn = [_path(_thinned(row), bottom, scale) for row in rows[:16]]
    zero = HEIGHT + bottom * scale
    axis = f'<path d="M0 {zero:.1f}H{WIDTH}" stroke-opacity=".4"/>'
    return _svg(f"{axis}{''.join(drawn)}", low, high)


def heat_map(values: Array, *, low: str, high: str) -> str:
    """A map of numbers from 0 to the largest, row 0 at the top as on every map.

    Parameters
    ----------
    values : ndarray, shape (row, column)
        0 or more.
    low, high : str
        What the faintest and the strongest shade mean.
    """
    rows, columns = values.shape
    top = float(values.max(initial=0.0))
    shades = np.clip(values / top, 0, 1) if top > 0 else np.zeros_like(values)
    side = min(HEIGHT / rows, WIDTH / columns)
    cells = "".join(
        f'<rect x="{column * side:.1f}" y="{row * side:.1f}" width="{side:.2f}" height="{side:.2f}" '
        f'fill="#d95f02" fill-opacity="{shades[row, column]:.2f}" stroke="none"/>'
        for row in range(rows)
        for column in range(columns)
        if shades[row, column] >= 0.01
    )
    frame = f'<rect width="{columns * side:.1f}" height="{rows * side:.1f}" fill="none" stroke-opacity=".4"/>'
    return _svg(f"{cells}{frame}", low, high)


def dots(x: Array, y: Array, turn: Array | None = None, *, low: str, high: str) -> str:
    """Places as dots, coloured by an angle where there is one.

    Parameters
    ----------
    x, y : ndarray, shape (dot,)
        In any unit, the same for both.
    turn : ndarray, shape (dot,), optional
        Angle of each in rad: its hue.
    low, high : str
        What stands below, left and right.
    """
    step = max(1, -(-len(x) // DOTS))
    x, y = x[::step], y[::step]
    wide = max(float(np.ptp(x)), float(np.ptp(y)) * WIDTH / HEIGHT, 1e-9)
    scale = 0.96 * WIDTH / wide
    hues = np.zeros(len(x)) if turn is None else np.degrees(np.mod(turn[::step], 2 * np.pi))
    grey = turn is None
    middle = (float(x.min() + x.max()) / 2, float(y.min() + y.max()) / 2)
    across = WIDTH / 2 + (x - middle[0]) * scale
    down = HEIGHT / 2 + (y - middle[1]) * scale  # y grows with the row, and row 0 is at the top
    drawn = "".join(
        f'<circle cx="{cx:.0f}" cy="{cy:.0f}" r="2" fill="{"currentColor" if grey else f"hsl({hue:.0f} 70% 55%)"}"/>'
        for cx, cy, hue in zip(across, down, hues, strict=True)
    )
    return _svg(f'<g stroke="none">{drawn}</g>', low, high)


def _thinned(row: Array) -> Array:
    """At most `POINTS` numbers that keep every peak: the lowest and the highest of each stretch."""
    if len(row) <= POINTS:
        return row
    edges = np.linspace(0, len(row), POINTS // 2 + 1).astype(int)[:-1]
    both = np.stack([np.minimum.reduceat(row, edges), np.maximum.reduceat(row, edges)], axis=1)
    return np.asarray(both.ravel(), float)


def _path(row: Array, bottom: float, scale: float) -> str:
    across = np.linspace(0, WIDTH, len(row))
    down = HEIGHT - (row - bottom) * scale
    steps = "L".join(f"{x:.0f} {y:.0f}" for x, y in zip(across, down, strict=True))
    return f'<path d="M{steps}" fill="none" stroke-opacity=".7"/>'


def _svg(drawing: str, low: str, high: str) -> str:
    text = 'font-size="11" font-family="sans-serif" fill="currentColor" stroke="none"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH + 8}" height="{HEIGHT + 24}" '
        f'viewBox="-4 -4 {WIDTH + 8} {HEIGHT + 24}" stroke="currentColor" fill="none">{drawing}'
        f'<text x="0" y="{HEIGHT + 14}" {text}>{escape(low)}</text>'
        f'<text x="{WIDTH}" y="{HEIGHT + 14}" text-anchor="end" {text}>{escape(high)}</text></svg>'
    )
