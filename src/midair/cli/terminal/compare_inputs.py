"""What commands that compare need to know of a recording's past: its band, its rate, what was felt."""

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from midair.files import open_take
from midair.lazy_frames import blocks
from midair.model import PressureFrames, Provenance
from midair.pipeline import calibrated_pressure
from midair.settings import Settings
from midair.temp_frames import TempFrames


def felt_part(
    source: Path, settings: Settings, start: float = 0.0, duration: float | None = None, *, streamed: bool = False
) -> PressureFrames:
    """What the sensor felt in a part of a recording, as a reel if `streamed`.

    It is the part of what all of it was calibrated to: cuts leave no edge.
    """
    take = open_take(source, streamed=streamed)
    pressure = calibrated_pressure(take.recording, take.calibration, settings)
    return pressure if start == 0 and duration is None else pressure.cut(start, duration)


@contextmanager
def kept_aside(pressure: PressureFrames) -> Generator[PressureFrames]:
    """The same pressure, worked out once and read from the disk from then on, while inside."""
    with TempFrames(*pressure.sensor.shape) as spool:
        for block in blocks(pressure.pressure):
            spool.append(block)
        # What takes a reel says so where it does; a noun's field is an array to everyone else.
        yield replace(pressure, pressure=cast("Any", spool.reel()))


def made_with(provenance: Provenance, settings: Settings) -> Settings:
    """The settings with the band and rate that a re-recording's drive was made with."""
    band, rate = provenance.last("calibrate").get("band_hz"), provenance.last("play").get("rate_hz")
    if isinstance(band, tuple) and len(band) == 2:
        low, high = (float(edge) for edge in band if isinstance(edge, int | float))
        settings = settings.but(band=(low, high))
    return settings.but(rate=float(rate)) if isinstance(rate, int | float) else settings
