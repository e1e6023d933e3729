"""What a noun says of itself at a glance: one line with units, cut to length, never the numbers of an array."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike


def told(noun: object, *parts: str, simulated: bool = False) -> str:
    """``<Noun part, part, SIMULATED>``; empty parts are left out."""
    said = [*filter(None, parts), *(["SIMULATED"] if simulated else [])]
    return f"<{type(noun).__name__} {', '.join(said)}>"


def clipped(text: str, most: int = 30) -> str:
    """`text` on one line of `most` characters at most: the middle goes, since names differ at their ends."""
    line = "".join(letter if letter.isprintable() else " " for letter in text)
    half = (most - 1) // 2
    return line if len(line) <= most else f"{line[:half]}…{line[-half:]}"


def clipped_list(words: Iterable[str], *, most: int = 4, letters: int = 20) -> str:
    """The first words, and how many more there are: ``calibrate, cut and 3 more``."""
    all_words = [clipped(word, letters) for word in words]
    more = len(all_words) - most
    return ", ".join(all_words[:most]) + (f" and {more} more" if more > 0 else "")


def counted(number: int, noun: str) -> str:
    """``1 frame``, ``2 frames``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def short(value: float) -> str:
    """Three digits, or a whole number where that is as short: ``0.0314``, ``2849``, ``1.2e+07``."""
    return f"{value:.0f}" if 999.5 <= abs(value) < 1e6 else f"{value + 0.0:.3g}"


def span(values: ArrayLike, unit: str = "") -> str:
    """``-0.31 to 0.42 V``, or ``1 V`` where all are alike."""
    low, high = (short(float(end)) for end in (np.min(values), np.max(values)))
    return (low if low == high else f"{low} to {high}") + (f" {unit}" if unit else "")


def lasting(frames: int, rate: float) -> str:
    """``1280 frames at 1000 Hz, 1.28 s``."""
    return f"{counted(frames, 'frame')} at {rate:g} Hz, {frames / rate:.4g} s"


def came_from(source: str) -> str:
    """``from virtual:towel``."""
    return f"from {clipped(source)}"
