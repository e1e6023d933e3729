"""Pair a re-recording with the part of the original that its provenance names."""

from dataclasses import dataclass, replace

from midair.evaluate import apply_band_twice
from midair.files import OpenedTake
from midair.model import PressureFrames, Provenance
from midair.pipeline import calibrated_pressure
from midair.settings import Settings
from midair.targets import add_lead, remove_lead


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlayedPair:
    """An original and its re-recording."""

    original: PressureFrames
    heard: PressureFrames
    """Re-recording, longer than the original at both ends where possible, so that a delay can be removed."""
    first: int = 0
    """Frame of `heard` at which the original begins."""

    @property
    def piece(self) -> PressureFrames:
        """Part of the re-recording at the original's frames, without removal of its delay."""
        end = self.first + self.original.frames
        return replace(self.heard, pressure=self.heard.pressure[self.first : end]) if self.first else self.heard


def aligned_pair(original: PressureFrames, take: OpenedTake, settings: Settings) -> PlayedPair:
    """Pair a re-recording with the part of the original that its provenance names; accepts lazy frames.

    The original of a played recording is filtered once more by the band, as a perfect rig would return it. A recording
    without a step "play" is compared directly.
    """
    provenance, calibration = take.recording.provenance, take.calibration
    if not provenance.last("play"):
        return PlayedPair(original=original, heard=calibrated_pressure(take.recording, calibration, settings))
    original, asked = original_of_drive(provenance, original)
    # A virtual sensor records the drive's first frame at time 0, and was at rest before.
    virtual = calibration is not None and calibration.provenance.simulated
    heard = calibrated_pressure(take.recording, calibration, settings, from_rest=virtual)
    reference = remove_lead(apply_band_twice(asked), original.frames)
    return PlayedPair(original=reference, heard=heard, first=(asked.frames - original.frames) // 2)


def original_of_drive(provenance: Provenance, original: PressureFrames) -> tuple[PressureFrames, PressureFrames]:
    """Part of an original that a drive's provenance names, without and with the lead of its solve."""
    cut, lead = provenance.last("cut"), provenance.last("lead").get("lead_s", 0.0)
    start, duration = cut.get("start_s"), cut.get("duration_s")
    if isinstance(start, int | float) and isinstance(duration, int | float):
        original = original.cut(float(start), float(duration))
    return original, add_lead(original, float(lead) if isinstance(lead, int | float) else 0.0)
