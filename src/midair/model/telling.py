"""What a noun says of itself in one line: shapes, spans and units, never its numbers."""

import numpy as np
from numpy.typing import NDArray

from midair.model.provenance import Provenance

LONGEST = 40
"""Letters of a name that are shown: no repr of a noun is longer than 300."""


def short(text: str) -> str:
    """A name, cut in its middle where it is long."""
    half = (LONGEST - 1) // 2
    return text if len(text) <= LONGEST else f"{text[:half]}…{text[-half:]}"


def span(values: NDArray[np.float64], unit: str) -> str:
    """From the smallest to the largest of some numbers, with their unit."""
    if not values.size:
        return "nothing"
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g} {unit}".strip() if low == high else f"{low:.3g} to {high:.3g} {unit}".strip()


def frames_at(frames: int, rate: float) -> str:
    """How many frames, how fast, how long."""
    return f"{frames} frames at {rate:g} Hz, {frames / rate:.4g} s"


def came_from(provenance: Provenance) -> str:
    """The source, how many steps since, and whether it is simulated."""
    steps = f", {len(provenance.steps)} steps since" if provenance.steps else ""
    return f"from {short(provenance.source)}{steps}" + (", SIMULATED" if provenance.simulated else "")
