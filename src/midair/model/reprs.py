"""One-line summaries with units for `repr`; the values of arrays are never printed."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike


def summary(value: object, *parts: str, simulated: bool = False) -> str:
    """``<Noun part, part, SIMULATED>``; empty parts are left out."""
    said = [*filter(None, parts), *(["SIMULATED"] if simulated else [])]
    return f"<{type(value).__name__} {', '.join(said)}>"


def clipped(text: str, most: int = 30) -> str:
    """`text` on one line of at most `most` characters; the middle is removed, since names differ at their ends."""
    line = "".join(letter if letter.isprintable() else " " for letter in text)
    half = (most - 1) // 2
    return line if len(line) <= most else f"{line[:half]}…{line[-half:]}"


def clipped_list(words: Iterable[str], *, most: int = 4, letters: int = 20) -> str:
    """The first words, and the number of the others: ``calibrate, cut and 3 more``."""
    all_words = [clipped(word, letters) for word in words]
    more = len(all_words) - most
    return ", ".join(all_words[:most]) + (f" and {more} more" if more > 0 else "")


def counted(number: int, noun: str) -> str:
    """``1 frame``, ``2 frames``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def short(value: float) -> str:
    """Three significant digits, or a whole number if that is as short: ``0.0314``, ``2849``, ``1.2e+07``."""
    return f"{value:.0f}" if 999.5 <= abs(value) < 1e6 else f"{value + 0.0:.3g}"


def span(values: ArrayLike, unit: str = "") -> str:
    """``-0.31 to 0.42 V``, or ``1 V`` if all values are equal."""
    low, high = (short(float(end)) for end in (np.min(values), np.max(values)))
    return (low if low == high else f"{low} to {high}") + (f" {unit}" if unit else "")


def frames_and_duration(frames: int, rate: float) -> str:
    """``1280 frames at 1000 Hz, 1.28 s``."""
    return f"{counted(frames, 'frame')} at {rate:g} Hz, {frames / rate:.4g} s"


def from_source(source: str) -> str:
    """``from virtual:towel``."""
    return f"from {clipped(source)}"
