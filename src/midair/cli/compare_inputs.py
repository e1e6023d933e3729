"""Inputs of commands that compare: calibrated pressure of a part, and the settings of a re-recording."""

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from midair.files import open_take
from midair.model import PressureFrames, Provenance
from midair.pipeline import calibrated_pressure
from midair.settings import Settings
from midair.streaming import TempFrames, blocks


def calibrated_part(
    source: Path, settings: Settings, start: float = 0.0, duration: float | None = None, *, streamed: bool = False
) -> PressureFrames:
    """Calibrated pressure of a part (lazy frames if `streamed`), cut after calibration so that filters leave no
    edges.
    """
    take = open_take(source, streamed=streamed)
    pressure = calibrated_pressure(take.recording, take.calibration, settings)
    return pressure if start == 0 and duration is None else pressure.cut(start, duration)


@contextmanager
def cached_pressure(pressure: PressureFrames) -> Generator[PressureFrames]:
    """The same pressure, computed once into a temporary file, inside the block."""
    with TempFrames(*pressure.sensor.shape) as spool:
        for block in blocks(pressure.pressure):
            spool.append(block)
        # The field is typed as an array; functions that accept lazy frames declare it.
        yield replace(pressure, pressure=cast("Any", spool.reel()))


def settings_of_rerecording(provenance: Provenance, settings: Settings) -> Settings:
    """Settings with the band and rate of the drive of a re-recording."""
    band, rate = provenance.last("calibrate").get("band_hz"), provenance.last("play").get("rate_hz")
    if isinstance(band, tuple) and len(band) == 2:
        low, high = (float(edge) for edge in band if isinstance(edge, int | float))
        settings = settings.but(band=(low, high))
    return settings.but(rate=float(rate)) if isinstance(rate, int | float) else settings
