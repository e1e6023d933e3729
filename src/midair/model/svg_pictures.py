"""Small SVG pictures for notebooks: traces, maps, dots and curves, each with its units.

Lines and labels use the text colour of the page, so that they are visible on white and on black. Data are thinned out
to about 1200 points (15 kB) per picture. Row 0 of a map is at the top and y increases downwards, as in all figures.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.model.reprs import short, span


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureStyle:
    """Colours and sizes; lengths in px."""

    width: int = 360
    left: int = 44
    """Margin for labels on the left; `right` is that on the right."""
    right: int = 92
    line: int = 16
    """Height of a line of text."""
    points: int = 1200
    """Maximum number of points in a picture."""
    quantity: tuple[str, ...] = (
        *("#440154", "#481a6c", "#472f7d", "#414487", "#39568c", "#31688e", "#2a788e", "#23888e"),
        *("#1f988b", "#22a884", "#35b779", "#54c568", "#7ad151", "#a5db36", "#d2e21b", "#fde725"),
    )
    """From low to high: 16 steps of viridis."""
    phase: tuple[str, ...] = (
        *("#d6809c", "#da827f", "#d78863", "#cc914e", "#b99b46", "#9fa550", "#80ae67", "#5db383"),
        *("#3bb5a1", "#2bb2bc", "#42acd2", "#63a4df", "#849be3", "#a091dd", "#b889cd", "#ca83b7"),
    )
    """A cycle of 16 hues of the same lightness .7 and chroma .11 (OKLCH), so that no phase looks like silence."""

    @property
    def inner(self) -> int:
        """Width between the margins, in px."""
        return self.width - self.left - self.right


def framed(value: object, picture: str, caption: str, *, simulated: bool = False) -> str:
    """A picture with a caption and the object's `repr`, as HTML; the caption marks simulated data."""
    words = escape(f"{caption}, SIMULATED" if simulated else caption)
    return (
        '<figure style="margin:0.5em 0;width:360px;max-width:100%">'
        f"{picture}"
        '<figcaption style="font:12px sans-serif;text-align:left">'
        f'{words}<br/><span style="opacity:0.7">{escape(repr(value))}</span></figcaption></figure>'
    )


def sparklines(values: Array, *, duration: float, unit: str, style: PictureStyle | None = None) -> str:
    """A trace of each channel (frame, row, column) at the position of its cell, all on one scale; 8 x 8 at most."""
    style = style or PictureStyle()
    shown = values[:, :: -(-values.shape[1] // 8), :: -(-values.shape[2] // 8)]
    rows, columns = shown.shape[1:]
    width, height = style.width / columns, min(90.0, 200 / rows)
    low, high = float(values.min()), float(values.max())
    up = (height - 6) / ((high - low) or 1)
    foot = 3 if high > low else height / 2
    if len(shown) == 1:
        shown = np.repeat(shown, 2, axis=0)  # One frame is drawn as a line: a dot would not be seen.
    time = np.linspace(0, 1, len(shown))
    parts: list[str] = []
    for row in range(rows):
        for column in range(columns):
            trace = shown[:, row, column]
            at = thinned(time, trace, style.points // (rows * columns) - 2)
            x = column * width + 3 + time[at] * (width - 6)
            parts.append(path_of(x, (row + 1) * height - foot - (trace[at] - low) * up))
    words = f"each: 0 to {duration:.4g} s, {span(values, unit)}"
    if rows * columns < values[0].size:
        words += f"; {rows * columns} of {values[0].size} channels"
    drawn = f'<path d="{"".join(parts)}" {_line(0.8)}/>'
    return _svg(drawn + _text(0, rows * height + style.line - 4, words), rows * height + style.line, style)


def heat_map(values: Array, x: Array, y: Array, *, unit: str, style: PictureStyle | None = None) -> str:
    """A map (row, column) in 16 colours from 0 to the maximum, with a colour bar; `x` and `y` are in m."""
    style = style or PictureStyle()
    shown = values  # beyond 32 rows or columns a square shows the maximum of several
    for axis, count in enumerate(values.shape):
        shown = np.maximum.reduceat(shown, np.arange(0, count, -(-count // 32)), axis=axis)
    rows, columns = shown.shape
    cell = style.inner / max(rows, columns)
    steps = len(style.quantity)
    top = float(values.max())
    colour = np.clip((shown / (top or 1) * steps).astype(int), 0, steps - 1)
    squares = "".join(
        f'<path fill="{style.quantity[k]}" d="{"".join(f"M{j} {i}h1v1h-1z" for i, j in np.argwhere(colour == k))}"/>'
        for k in np.unique(colour)
    )
    width, height = columns * cell, max(rows * cell, 2.0 * style.line)
    place = f'transform="translate({style.left} 4) scale({cell:.3f})" shape-rendering="crispEdges"'
    return _svg(
        f"<g {place}>{squares}</g>"
        + _places(x, y, width, rows * cell, style)
        + _bar(style.quantity, f"{short(top)} {unit}", f"0 {unit}", style.left + width + 10, height),
        height + 8 + style.line,
        style,
    )


def dots(
    position: Array,
    colour: NDArray[np.int64],
    *,
    bar: tuple[str, str] | None = None,
    style: PictureStyle | None = None,
) -> str:
    """Transducers from above, as dots of the cyclic colours 0 to 15; -1 is a faint dot, `bar` labels last and first."""
    style = style or PictureStyle()
    place = position[:, :2]
    low, high = place.min(axis=0), place.max(axis=0)
    if len(place) > style.points:
        extent = high - low
        pitch = max(float(np.sqrt(extent.prod() / style.points)), 3 * float(extent.max()) / style.points) or 1.0
        coarse = np.floor((place - low) / pitch)
        kept = np.unique(coarse, axis=0, return_index=True)[1]
        place, colour = place[kept], colour[kept]
    scale = min(style.inner / (high - low).max(), 1e6) if (high > low).any() else 1.0
    width, height = np.maximum((high - low) * scale, 2.0 * style.line)
    size = min(12.0, 0.85 * float(np.sqrt(width * height / len(place))))
    pixel = np.round((place - low) * scale, 1)
    drawn = "".join(
        f'<path d="{"".join(f"M{x:g} {y:g}h0" for x, y in pixel[colour == k])}" '
        + (f'stroke="{style.phase[k]}"/>' if k >= 0 else 'stroke="currentColor" stroke-opacity="0.25"/>')
        for k in np.unique(colour)
    )
    inset = 4 + size / 2
    group = f'<g transform="translate({style.left + size / 2:.1f} {inset:.1f})" stroke-width="{size:.1f}"'
    drawn = f'{group} stroke-linecap="round">{drawn}</g>'
    drawn += _places(np.array([low[0], high[0]]), np.array([low[1], high[1]]), width + size, height + size, style)
    if bar is not None:
        drawn += _bar(style.phase, *bar, style.left + width + size + 10, height)
    return _svg(drawn, height + size + 8 + style.line, style)


def curve(
    x: Array,
    y: Array,
    *,
    x_label: str,
    y_unit: str,
    around: tuple[Array, Array] | None = None,
    logarithmic: bool = False,
    style: PictureStyle | None = None,
) -> str:
    """A line over increasing `x` from 0, with a gap where it is NaN; `around` are the ends of a shaded range."""
    style = style or PictureStyle()
    width, height, foot = style.width - style.left - 10, 100, 100 + style.line + 2
    known = np.concatenate([y, *(around or ())])
    top = float(np.nanmax(known)) if np.isfinite(known).any() else 0.0
    place = np.log10(x) if logarithmic else x
    place = style.left + (place - place[0]) * (width / (float(place[-1] - place[0]) or 1))
    up = height / (top or 1)
    drawn = f'<path d="M{style.left} {foot - height}v{height}h{width}" {_line(0.5)} stroke-opacity="0.6"/>'
    if around is not None:
        low, high = (thinned(place, end, style.points // 4) for end in around)
        ends = np.concatenate([around[0][low], around[1][high][::-1]])
        outline = path_of(place[np.concatenate([low, high[::-1]])], foot - ends * up)
        drawn += f'<path d="{outline}z" fill="currentColor" fill-opacity="0.2"/>'
    at = thinned(place, y, style.points // 3)
    drawn += f'<path d="{path_of(place[at], foot - y[at] * up)}" {_line(1.2)}/>'
    drawn += _text(0, 12, f"{short(top)} {y_unit}") + _text(style.left - 4, foot, "0", "end")
    drawn += _marks(x, place, foot + style.line - 3, x_label, logarithmic=logarithmic)
    return _svg(drawn, foot + style.line + 4, style)


def thinned(at: Array, values: Array, most: int) -> NDArray[np.intp]:
    """Up to `most` + 2 indices of a trace: its ends, and minimum and maximum of each of `most` / 2 equal intervals."""
    if len(values) <= most:
        return np.arange(len(values))
    start = np.unique(np.searchsorted(at, np.linspace(at[0], at[-1], max(most // 2, 1), endpoint=False)))
    chosen = [0, len(values) - 1]
    for first, last in zip(start, [*start[1:], len(values)], strict=True):
        part = values[first:last]
        known = np.isfinite(part).any()
        chosen += [first + np.nanargmin(part), first + np.nanargmax(part)] if known else [first]
    return np.unique(chosen)


def path_of(x: Array, y: Array) -> str:
    """An SVG path through points in px, interrupted at each NaN; an isolated point becomes a dot."""
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if not len(known):
        return ""
    runs = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)
    lines = [run if len(run) > 1 else np.repeat(run, 2) for run in runs]
    return "".join("M" + " ".join(f"{x[i]:.4g} {y[i]:.4g}" for i in line) for line in lines)


def _svg(inside: str, height: float, style: PictureStyle) -> str:
    size = f'width="{style.width}" height="{height:.0f}" viewBox="0 0 {style.width} {height:.0f}"'
    look = 'style="max-width:100%;font:11px sans-serif;color:inherit"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" role="img" {size} {look}>{inside}</svg>'


def _line(width: float) -> str:
    look = 'fill="none" stroke="currentColor" stroke-linejoin="round" stroke-linecap="round"'
    return f'{look} stroke-width="{width:g}"'


def _text(x: float, y: float, words: str, anchor: str = "start") -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" fill="currentColor">{escape(words)}</text>'


def _marks(x: Array, place: Array, foot: float, label: str, *, logarithmic: bool) -> str:
    """Labels for the ends of an axis, and for its decades where there is room."""
    drawn = _text(place[0], foot, short(x[0])) + _text(place[-1], foot, f"{short(x[-1])} {label}", "end")
    if logarithmic:
        decades = 10.0 ** np.arange(np.floor(np.log10(x[0])) + 1, np.ceil(np.log10(x[-1])))
        where = np.interp(np.log10(decades), np.log10(x), place)
        free = (where > place[0] + 40) & (where < place[-1] - 70)
        drawn += "".join(_text(w, foot, f"{d:g}", "middle") for d, w in zip(decades[free], where[free], strict=True))
    return drawn


def _places(x: Array, y: Array, width: float, height: float, style: PictureStyle) -> str:
    """Labels for the first and the last position on both axes, in mm."""
    left, foot = style.left, height + 4 + style.line - 3
    return (
        _text(left - 4, 13, f"{1e3 * y[0]:.3g}", "end")
        + _text(left - 4, height + 4, f"{1e3 * y[-1]:.3g}", "end")
        + _text(left, foot, f"{1e3 * x[0]:.3g}")
        + _text(left + width, foot, f"{1e3 * x[-1]:.3g} mm", "end")
    )


def _bar(colours: Sequence[str], high: str, low: str, x: float, height: float) -> str:
    """A vertical colour bar, the last colour at the top, with labels of both ends."""
    step = height / len(colours)
    boxes = "".join(f'<path fill="{each}" d="M0 {-k}h10v-1h-10z"/>' for k, each in enumerate(colours))
    place = f'transform="translate({x:.1f} {4 + height:.1f}) scale(1 {step:.3f})" shape-rendering="crispEdges"'
    return f"<g {place}>{boxes}</g>" + _text(x + 14, 13, high) + _text(x + 14, 4 + height, low)
