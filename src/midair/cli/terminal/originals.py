"""What commands that compare need to know of a recording's past: band, rate, and the part that was played."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from midair.evaluate import heard_perfectly
from midair.files import OpenedTake, open_take
from midair.flow import felt
from midair.model import PressureFrames, Provenance, Setting
from midair.reel import blocks
from midair.settings import Settings
from midair.spool import Spool
from midair.targets import led_in, without_lead


def felt_part(
    source: Path, settings: Settings, start: float = 0.0, duration: float | None = None, *, streamed: bool = False
) -> PressureFrames:
    """What the sensor felt in a part of a recording, as a reel if `streamed`.

    It is the part of what all of it was calibrated to: cuts leave no edge.
    """
    take = open_take(source, streamed=streamed)
    pressure = felt(take.recording, take.calibration, settings)
    return pressure if start == 0 and duration is None else pressure.cut(start, duration)


@contextmanager
def kept_aside(pressure: PressureFrames) -> Generator[PressureFrames]:
    """The same pressure, worked out once and read from the disk from then on, while inside."""
    with Spool(*pressure.sensor.shape) as spool:
        for block in blocks(pressure.pressure):
            spool.append(block)
        # What takes a reel says so where it does; a noun's field is an array to everyone else.
        yield replace(pressure, pressure=cast("Any", spool.reel()))


def made_with(provenance: Provenance, settings: Settings) -> Settings:
    """The settings with the band and rate that a re-recording's drive was made with."""
    band, rate = _step(provenance, "calibrate").get("band_hz"), _step(provenance, "play").get("rate_hz")
    if isinstance(band, tuple) and len(band) == 2:
        low, high = (float(edge) for edge in band if isinstance(edge, int | float))
        settings = settings.but(band=(low, high))
    return settings.but(rate=float(rate)) if isinstance(rate, int | float) else settings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlayedPair:
    """An original, and what was heard of it.

    Attributes
    ----------
    original, heard : PressureFrames
        What was heard goes on before and behind, as far as it was kept, so that a delay can be taken out of it.
    first : int
        Its frame at which the original begins.
    """

    original: PressureFrames
    heard: PressureFrames
    first: int = 0

    @property
    def piece(self) -> PressureFrames:
        """What was heard where the original is, its delay left in."""
        end = self.first + self.original.frames
        return replace(self.heard, pressure=self.heard.pressure[self.first : end]) if self.first else self.heard


def brought_together(original: PressureFrames, take: OpenedTake, settings: Settings) -> PlayedPair:
    """The part of an original that a re-recording says it is of, and the re-recording; of reels.

    What was played is compared as a perfect rig would give it back: through the band once more. A recording that does
    not say that it was played is compared as it is.
    """
    provenance, calibration = take.recording.provenance, take.calibration
    if not _step(provenance, "play"):
        return PlayedPair(original=original, heard=felt(take.recording, calibration, settings))
    original, asked = asked_of(provenance, original)
    # A virtual sensor hears the drive's first frame at time 0, and has been at rest until then.
    virtual = calibration is not None and calibration.provenance.simulated
    heard = felt(take.recording, calibration, settings, from_rest=virtual)
    reference = without_lead(heard_perfectly(asked), original.frames)
    return PlayedPair(original=reference, heard=heard, first=(asked.frames - original.frames) // 2)


def asked_of(provenance: Provenance, original: PressureFrames) -> tuple[PressureFrames, PressureFrames]:
    """The part of an original that a drive's life says it is of, and the same with the lead that it was solved with."""
    cut, lead = _step(provenance, "cut"), _step(provenance, "lead").get("lead_s", 0.0)
    start, duration = cut.get("start_s"), cut.get("duration_s")
    if isinstance(start, int | float) and isinstance(duration, int | float):
        original = original.cut(float(start), float(duration))
    return original, led_in(original, float(lead) if isinstance(lead, int | float) else 0.0)


def _step(provenance: Provenance, stage: str) -> Mapping[str, Setting]:
    """The settings of the last step of that name; none if there was none."""
    return next((step.settings for step in reversed(provenance.steps) if step.stage == stage), {})
