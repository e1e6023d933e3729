"""What a perfect reproduction would be heard as, which is what a re-recording is to be compared with.

An original has passed the soft edges of the band once, when it was calibrated. What is played of it is heard and
calibrated again, and so passes them twice: at a corner, where half is left of the original, a quarter is left of a
perfect reproduction. Compared with the original itself, it would lack what nobody can play.
"""

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from midair.dsp import band_edges, band_window, filter_response
from midair.lazy_filters import pad_with_silence
from midair.model import PressureFrames

Array = NDArray[np.float64]


def apply_band_twice(asked: PressureFrames) -> PressureFrames:
    """A pressure as a sensor would hear it of a perfect rig: through its own band once more, silent before and after.

    Parameters
    ----------
    asked : PressureFrames
        What is played, in the band that it says; with none it stays as it is. Of a reel a reel.

    Returns
    -------
    PressureFrames
        Same rate and frames.
    """
    band = asked.band
    if band is None:
        return asked
    edges = _edges(asked)

    def window(frequency: Array) -> Array:
        return band_window(frequency, band, edges=edges).reshape(-1, 1, 1)

    rest = is_silent(band, asked.rate)
    longer = cast("Array", pad_with_silence(asked.pressure, rest))
    heard = filter_response(longer, asked.rate, window, reach=rest / asked.rate)
    return replace(asked, pressure=heard[rest : rest + asked.frames])


def is_silent(band: tuple[float, float], rate: float) -> int:
    """Frames of silence after which the filter of a band has forgotten: four periods of its lower corner."""
    return int(np.ceil(4 * rate / max(band[0], 1.0)))


def _edges(asked: PressureFrames) -> tuple[float, float]:
    """Edges of the band with which it was calibrated; the usual ones where nothing tells."""
    for step in reversed(asked.provenance.steps):
        edges = step.settings.get("edges_hz")
        if step.stage == "calibrate" and isinstance(edges, tuple) and len(edges) == 2:
            rise, fall = (float(width) for width in edges if isinstance(width, int | float))
            return rise, fall
    return band_edges(asked.band or (0.0, asked.rate / 2), asked.rate)
