"""The exposure check of frames that are steered to a palm while they play."""

from dataclasses import dataclass, replace

import numpy as np

from midair.array_types import Array
from midair.devices import exposure_check as check
from midair.devices.exposure_check import ArrayInfo, ExposureChoices, ExposureClearance
from midair.devices.frame_bytes import actual_level
from midair.errors import ExposureError
from midair.model import Drive, PalmPath
from midair.physics import PoseBox, exposure_excess

UNSAMPLED = 1.5
"""Level in dB that is added to that of sampled poses of a palm or jumps, since others are louder (decision 0047)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SteeredClearance(ExposureClearance):
    """Permission to play frames that are steered to the poses of a box; created by `check_exposure_steered`."""

    box: PoseBox
    """Poses to which frames may be steered."""
    solved: Array
    """Centre of the palm that they were solved for, shape (3,), in m."""
    factor: float
    """Attenuation factor of the frames."""
    louder: float
    """Level of the loudest moment between two frames above that of frames alone, in dB."""
    steps: int
    """Phase steps per turn of the device."""

    def steered(self, frames: Drive, poses: PalmPath | None) -> Drive:
        """Clear frames that were steered to these poses; None for silent ones.

        Unless the device has no sound, each frame is measured alone in the air of the room, or bounded by those beside
        it (`exposure_excess`), and weakened if it exceeds the profile, or the excess for which a person is responsible.
        Moments while frames arrive are as much louder than frames alone as those of the drive as it was solved, or of
        samples that jump.
        Raises ExposureError if a pose is outside the box, a frame above the cleared level, or not one for all.
        """
        if frames.level.ndim > 1:
            raise ExposureError("steered frames: expected one level for all transducers, got one for each")
        if poses is not None and not self.box.inside(poses, self.solved).all():
            raise ExposureError("steered frames: expected poses in the box that was checked, got one outside")
        own = replace(frames, array=self.array)
        own = own if self.factor == 1 else check.weakened(own, self.factor, self.exposure.profile.name)
        self.check_level(own)
        if not self.gated or not own.level.any():
            return own
        answered = max(0.0, self.exposure.sound_excess) if self.outcome == "overridden" else 0.0
        played, allowed = replace(own, level=actual_level(own.level)), answered - self.louder
        # One frame of each millisecond is measured, and those between if the bound for them exceeds what is allowed.
        found, stride = self.exposure, max(1, round(1e-3 * own.rate))
        excess = exposure_excess(played, found.profile, found.airs, steps=self.steps, stride=stride, above=allowed)
        loud = (excess := excess - allowed) > 0
        if not loud.any():
            return own
        # Rounded down to the firmware's steps; a tenth of a decibel covers the rounding of the search.
        factors = np.where(loud, 10 ** (-(excess + 0.1) / 20), 1.0)
        return replace(own, level=np.where(loud, check.strongest_below(own.level * factors), own.level))


def check_exposure_steered(
    drive: Drive,
    device: ArrayInfo,
    choices: ExposureChoices,
    *,
    box: PoseBox,
    solved: Array,
    samples: Drive,
    jumps: bool = False,
    repeats: int = 1,
    endless: bool = False,
) -> SteeredClearance:
    """Check a drive whose frames will be steered to the poses of a box while it plays.

    The drive is measured as it was solved, and `samples` alone: some of its frames, steered to poses of the box. Every
    frame is measured again once it was steered, by `SteeredClearance.steered`, before it sounds. The heat is that of
    the drive as it was solved.

    With `jumps`, frames may be followed by any others: `samples` are also measured one after another.

    `box` are the admitted poses around the `solved` centre of the palm, shape (3,), in m. The other parameters and
    errors are those of `check_exposure`.
    """
    own = check.measured_on(drive, device, choices, check.passes_counted(drive, repeats, endless=endless))
    louder = max(0.0, own.sound_excess - check.measured_on(drive, device, choices, 1, alone=True).sound_excess)
    others = check.measured_on(samples, device, choices, 1, alone=True)
    if jumps:
        alone, moments = (each.above.max(axis=1) for each in (others, check.measured_on(samples, device, choices, 1)))
        louder = max(louder, float((moments - np.maximum(alone, np.append(alone[:1], alone[:-1]))).max()) + UNSAMPLED)
    found = replace(
        own,
        level=np.concatenate([own.level, others.level + louder + (0 if jumps else UNSAMPLED)]),
        air=np.concatenate([own.air, others.air]),
        pressure=max(own.pressure, others.pressure),
    )
    outcome, factor = check.decide(found, device, choices)
    most = np.array([drive.level.max(initial=0.0)])
    top = most if factor == 1 else check.strongest_below(most * factor)
    # A level between two steps is played as the nearest one.
    level = float(np.maximum(top, actual_level(np.rint(255 * top) / 255))[0])
    # The clearance states what will be played; no factor ends above the limit for its last bit.
    found = found if factor == 1 else found.weakened(min(factor * (1 - 1e-9), level / float(most[0])))
    own_fields = {"box": box, "solved": solved, "louder": louder, "steps": device.steps_a_turn}
    return check.cleared(SteeredClearance, device, choices, found, outcome, level=level, factor=factor, **own_fields)
