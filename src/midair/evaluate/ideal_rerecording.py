"""Re-recording of a perfect reproduction, as the reference for a measured re-recording.

An original has passed the soft edges of the band once, during calibration. Its reproduction is recorded and calibrated
again, so it passes them twice: at a corner, where half of the original's amplitude is left, a perfect reproduction has
a quarter. A comparison with the original itself would count this as an error.
"""

from dataclasses import replace
from typing import cast

import numpy as np

from midair.array_types import Array
from midair.dsp import band_edges, band_window, filter_response
from midair.model import PressureFrames
from midair.streaming import pad_with_silence


def apply_band_twice(asked: PressureFrames) -> PressureFrames:
    """Filter a pressure with its own band again, as the re-recording of a perfect reproduction.

    Silence is assumed before and after. A pressure without a band is returned unchanged; lazy frames give lazy frames.
    """
    band = asked.band
    if band is None:
        return asked
    edges = _edges(asked)

    def window(frequency: Array) -> Array:
        return band_window(frequency, band, edges=edges).reshape(-1, 1, 1)

    rest = band_settling_frames(band, asked.rate)
    longer = cast("Array", pad_with_silence(asked.pressure, rest))
    heard = filter_response(longer, asked.rate, window, reach=rest / asked.rate)
    return replace(asked, pressure=heard[rest : rest + asked.frames])


def band_settling_frames(band: tuple[float, float], rate: float) -> int:
    """Number of silent frames after which a band's filter has decayed: four periods of the lower corner."""
    return int(np.ceil(4 * rate / max(band[0], 1.0)))


def _edges(asked: PressureFrames) -> tuple[float, float]:
    """Edges of the band in the calibration step of the provenance, or the default edges."""
    edges = asked.provenance.last("calibrate").get("edges_hz")
    if isinstance(edges, tuple) and len(edges) == 2:
        rise, fall = (float(width) for width in edges if isinstance(width, int | float))
        return rise, fall
    return band_edges(asked.band or (0.0, asked.rate / 2), asked.rate)
