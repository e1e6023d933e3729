"""A re-recording beside the part of its original that it says it is of."""

from dataclasses import dataclass, replace

from midair.evaluate import apply_band_twice
from midair.files import OpenedTake
from midair.model import PressureFrames, Provenance
from midair.pipeline import calibrated_pressure
from midair.settings import Settings
from midair.targets import led_in, without_lead


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


def aligned_pair(original: PressureFrames, take: OpenedTake, settings: Settings) -> PlayedPair:
    """The part of an original that a re-recording says it is of, and the re-recording; of reels.

    What was played is compared as a perfect rig would give it back: through the band once more. A recording that does
    not say that it was played is compared as it is.
    """
    provenance, calibration = take.recording.provenance, take.calibration
    if not provenance.last("play"):
        return PlayedPair(original=original, heard=calibrated_pressure(take.recording, calibration, settings))
    original, asked = asked_of(provenance, original)
    # A virtual sensor hears the drive's first frame at time 0, and has been at rest until then.
    virtual = calibration is not None and calibration.provenance.simulated
    heard = calibrated_pressure(take.recording, calibration, settings, from_rest=virtual)
    reference = without_lead(apply_band_twice(asked), original.frames)
    return PlayedPair(original=reference, heard=heard, first=(asked.frames - original.frames) // 2)


def asked_of(provenance: Provenance, original: PressureFrames) -> tuple[PressureFrames, PressureFrames]:
    """The part of an original that a drive's life says it is of, and the same with the lead that it was solved with."""
    cut, lead = provenance.last("cut"), provenance.last("lead").get("lead_s", 0.0)
    start, duration = cut.get("start_s"), cut.get("duration_s")
    if isinstance(start, int | float) and isinstance(duration, int | float):
        original = original.cut(float(start), float(duration))
    return original, led_in(original, float(lead) if isinstance(lead, int | float) else 0.0)
