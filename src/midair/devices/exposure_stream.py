"""The exposure check of a drive that is still being solved, part by part."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.devices import exposure_check as check
from midair.devices.exposure_check import ArrayInfo, ExposureChoices, ExposureClearance
from midair.devices.frame_bytes import PHASE_STEPS, actual_level, intensity_bytes, phase_bytes
from midair.errors import InputError, MismatchError
from midair.model import Drive
from midair.physics import Exposure, airs_of_room, frames_at_once, heat_so_far
from midair.streaming import ArrivingFrames, concatenate_lazy, each_frame

_TURN = PHASE_STEPS / (2 * np.pi)
"""Phase steps per radian."""


class ExposureStream:
    """Checks and keeps the frames of a drive that is still being solved, part by part, ahead of their sound.

    A part that passes can be read in the drive of `clearance`; no other frames can. For all frames the verdict is that
    of `check_exposure`. Phases, and levels of single transducers, are kept in the steps of AUTD3 units.

    `first` is the first part, and `frames` the number of all frames. The other parameters, and the errors, are those of
    `check_exposure`; InputError for `choices` with `attenuate`, which needs the whole drive.
    """

    def __init__(
        self, first: Drive, device: ArrayInfo, choices: ExposureChoices, *, frames: int, repeats: int = 1
    ) -> None:
        if choices.attenuate:
            raise InputError("exposure of a stream: expected no attenuation, which needs the whole drive, got it")
        check.passes_counted(first, repeats, endless=False)
        self._device, self._choices, self._repeats = device, choices, repeats
        self._level_steps = None if first.level.ndim == 1 else 255.0
        self._level = level = ArrivingFrames((frames, *first.level.shape[1:]), steps=self._level_steps)
        self.phase = ArrivingFrames((frames, device.array.count), steps=_TURN)
        """The phases that passed; its `there` is that of the stream."""
        self._drive = replace(first, phase=cast("Array", self.phase), level=cast("Array", level), array=device.array)
        airs = airs_of_room(choices.room, choices.profile.places, device.array)
        self._heat = heat_so_far(frames, choices.profile, airs, repeats=repeats)
        self._beside = frames_at_once(first, choices.profile, airs)
        self._measured: list[Exposure] = []
        self.add(first)

    def add(self, part: Drive) -> None:
        """Check the next frames, and let them be read; raises ExposureError if the play up to them exceeds."""
        done = self.phase.there
        if part.rate != self._drive.rate:
            raise MismatchError(f"parts: expected all at {self._drive.rate:g} Hz, got one at {part.rate:g} Hz")
        check.check_drive(part, self._device.array)
        phase = phase_bytes(part, 1)[:, 0]
        level = part.level if self._level_steps is None else intensity_bytes(part, 1)[:, 0]
        # The steps are checked that will sound.
        own = replace(part, phase=phase / _TURN, level=level / (self._level_steps or 1.0))
        level_so_far = concatenate_lazy([self._level[:done], own.level])
        known = replace(own, phase=concatenate_lazy([self.phase[:done], own.phase]), level=level_so_far)
        heat = self._heat.add(replace(known, level=each_frame(known.level, actual_level)))
        earlier, ends = min(done, self._beside), known.frames == len(self.phase)
        found = self._part(known, np.arange(done - earlier, known.frames), heat, earlier=earlier, ends=ends)
        if ends and self._repeats > 1:
            # The first frames sound beside the last ones, at the end of the drive.
            around = np.arange(-self._beside, self._beside) % known.frames
            again = self._part(known, around, heat, earlier=self._beside, ends=False)
            found = replace(found, level=np.concatenate([found.level[:-1], [np.maximum(found.level[-1], again.peak)]]))
        if found.excess > 0:
            check.decide(_joined([*self._measured, found]), self._device, self._choices)
        # Phases come last: with them a frame is there.
        self._level.append(level)
        self.phase.append(phase)
        self._measured.append(found)

    def fail(self, error: BaseException) -> None:
        """End with an error, which every later read of the drive raises."""
        self._level.fail(error)
        self.phase.fail(error)

    def _part(self, known: Drive, frames: NDArray[np.intp], heat: tuple[Array, float], **when: Any) -> Exposure:
        """Exposure to some frames; the heat is that of all."""
        some = replace(known, phase=np.asarray(known.phase[frames]), level=np.asarray(known.level[frames]))
        found = check.measured_on(some, self._device, self._choices, 1, heat=heat, **when)
        return replace(found, repeats=self._repeats)

    def clearance(self) -> ExposureClearance:
        """Permission to play all frames, with the exposure of those up to now; a read waits until its frames passed."""
        return self._cleared(self._measured, drive=self._drive, later=self._so_far)

    def _so_far(self) -> ExposureClearance:
        parts = list(self._measured)
        done = sum(len(each.level) for each in parts)
        drive = replace(self._drive, phase=self.phase.kept(done), level=self._level.kept(done))
        return self._cleared(parts, drive=drive)

    def _cleared(self, parts: list[Exposure], **rest: Any) -> ExposureClearance:
        found = _joined(parts)
        outcome, _ = check.decide(found, self._device, self._choices)
        # Later parts may exceed the profile, for which the person is responsible from the beginning.
        outcome = outcome if self._choices.override is None else "overridden"
        return check.cleared(
            ExposureClearance, self._device, self._choices, found, outcome, repeats=self._repeats, **rest
        )


def _joined(parts: list[Exposure]) -> Exposure:
    """Exposure of consecutive parts of a drive, the last of which has the heat of all."""
    return replace(
        parts[-1],
        level=np.concatenate([each.level for each in parts]),
        air=np.concatenate([each.air for each in parts]),
        nonlinearity=max(each.nonlinearity for each in parts),
        pressure=max(each.pressure for each in parts),
    )
