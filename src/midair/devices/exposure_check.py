"""The exposure check, which is mandatory before playback.

`check_exposure` computes the exposure of people to a drive on the array that will play it, before any sound. It returns
an `ExposureClearance`, the only type that `ArrayDevice.play` accepts, and only this module can create one.
"""

import hashlib
from collections.abc import Callable
from dataclasses import InitVar, dataclass, replace
from math import ceil
from typing import Any, Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.devices.frame_bytes import PHASE_STEPS, actual_level, amplitude_of, intensity_bytes, phase_bytes
from midair.errors import DeviceStateError, ExposureError, InputError, MismatchError
from midair.evaluate import SkinModel
from midair.model import Drive, Medium, PalmPath, TransducerArray
from midair.physics import (
    MINUTE,
    Exposure,
    ExposureProfile,
    PoseBox,
    airs_of_room,
    exposure,
    exposure_excess,
    frames_at_once,
    greatest_exposure,
    heat_so_far,
)
from midair.streaming import ArrivingFrames, LazyFrames, cached_blocks, concatenate_lazy, each_frame

Outcome = Literal["kept", "attenuated", "overridden", "exceeded"]
"""Within the limits; attenuated to meet them; above them under the responsibility of a named person; above them on a
device without sound."""

_TURN = PHASE_STEPS / (2 * np.pi)
"""Phase steps per radian."""

UNSAMPLED = 1.5
"""Level in dB that is added to that of sampled poses of a palm, since others are louder (decision 0047)."""

_KEY = object()  # Key to the constructor of ExposureClearance, private to this module.


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureChoices:
    """Exposure limits, the action if a drive exceeds them, and the air; passed as a whole.

    Raises InputError if an override has no name.
    """

    profile: ExposureProfile
    """Limits for every drive."""
    attenuate: bool = False
    """Whether to attenuate a drive that exceeds the profile, all frames by the same factor, until it meets it."""
    override: str | None = None
    """Name of the person who takes responsibility for playing a drive that exceeds the profile."""
    up_to: float = np.inf
    """Excess in dB above the profile up to which the override applies."""
    room: Medium | None = None
    """Air in the room, stated by the user or measured; 2 degrees and 20 % of humidity around it are checked.

    If None, 14 to 30 degrees are checked. Never pass a default, or the air stored in a file; a humidity of 50 %, the
    default of `Medium.at`, counts as not stated.
    """

    def __post_init__(self) -> None:
        if self.override is not None and not self.override.strip():
            raise InputError("--override-exposure: expected the name of the person responsible, got none")


class ArrayInfo(Protocol):
    """The attributes of a device that `check_exposure` needs; see `ArrayDevice`."""

    name: str
    array: TransducerArray
    gated: bool
    steps_a_turn: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExposureClearance:
    """Permission to play a drive on one array a number of times; created only by the functions of this module."""

    drive: Drive | None
    """The drive to play, after any attenuation; None if the frames come later (see `frames`)."""
    array: TransducerArray
    """The device's array, for which the exposure was computed."""
    exposure: Exposure
    """Exposure to what will be played."""
    outcome: Outcome
    """Outcome of the check; "exceeded" only on a device without sound."""
    by: str = ""
    """Name of the person responsible for an override."""
    named: str = ""
    """Name of the person who would be responsible, stated whether it is needed or not."""
    repeats: int = 1
    """Number of consecutive repeats."""
    gated: bool = True
    """True if it was issued for a gated device, which can emit sound."""
    level: float = 0.0
    """Maximum level of frames that come later, 0 to 1."""
    factor: float = 1.0
    """Attenuation factor for frames that come later."""
    box: PoseBox | None = None
    """Poses to which frames that come later may be steered; None if they may not be steered."""
    solved: Array | None = None
    """Centre of the palm that they were solved for, shape (3,), in m."""
    louder: float = 0.0
    """Level of the loudest moment above that of the loudest frame alone, in dB, for frames that are steered."""
    steps: int = PHASE_STEPS
    """Phase steps per turn of the device."""
    later: "Callable[[], ExposureClearance] | None" = None
    """Returns the clearance of the frames up to now, of a drive that is still being checked; see `ExposureStream`."""
    _key: InitVar[object] = None

    def __post_init__(self, _key: object) -> None:
        if _key is not _KEY:
            raise DeviceStateError("clearance: expected the result of check_exposure(); it cannot be made up")

    def check_array(self, device: ArrayInfo) -> None:
        """Raise MismatchError if the device's array differs from the checked one, or is louder; DeviceStateError if it
        was issued for a device without sound and this device can emit sound.
        """
        if not self.array.same_as(device.array) or device.array.pressure > self.array.pressure * (1 + 1e-9):
            raise MismatchError(
                f"{device.name}: expected a drive that was checked for it, got one checked for {self.array.name}"
            )
        if device.gated and not self.gated:
            raise DeviceStateError(
                f"{device.name}: expected a drive that was checked on a device with sound; check it again"
            )

    def check_for(self, device: ArrayInfo) -> Drive:
        """Return the drive if it was cleared for this device.

        Raises as `check_array`, and DeviceStateError also if its frames come later.
        """
        self.check_array(device)
        if self.drive is None:
            raise DeviceStateError(f"{device.name}: expected frames to play, got a clearance for frames to come")
        return self.drive

    @property
    def strongest(self) -> int:
        """Largest intensity byte, 0 to 255: of the drive; for frames that come later neither nominal nor actual level
        exceeds `level`.
        """
        if self.drive is not None:
            return int(intensity_bytes(self.drive, 1).max(initial=0))
        steps = np.arange(256, dtype=np.uint8)
        # The tolerance keeps a level that equals a step from being rounded down.
        return int(np.flatnonzero(np.maximum(steps / 255, amplitude_of(steps)) <= self.level * (1 + 1e-9))[-1])

    def frames(self, drive: Drive) -> "ExposureClearance":
        """Clear frames within the level of `check_exposure_level`, computed after the check.

        Raises MismatchError if array or rate differ, ExposureError if the frames exceed the cleared level.
        """
        if not self.array.same_as(drive.array):
            raise MismatchError(f"frames: expected some for {self.array.name}, got some for {drive.array.name}")
        if drive.rate != self.exposure.rate:
            raise MismatchError(f"frames: expected some at {self.exposure.rate:g} Hz, got some at {drive.rate:g} Hz")
        # The firmware rounds to 255 steps; the check of the level includes this rounding.
        if drive.level.max(initial=0.0) > self.level + 1e-9:
            raise ExposureError(
                f"frames: expected a level of at most {self.level:g} of full drive, got {drive.level.max():g}"
            )
        return replace(self, drive=replace(drive, array=self.array), _key=_KEY)

    def steered(self, frames: Drive, poses: PalmPath | None) -> Drive:
        """Clear frames that were steered to these poses; None for silent ones.

        Unless the device has no sound, each frame is measured alone in the air of the room, or bounded by those beside
        it (`exposure_excess`), and weakened if it exceeds the profile, or the excess for which a person is responsible.
        Moments while frames arrive are as much louder than frames alone as those of the drive as it was solved.
        Raises ExposureError if a pose is outside the box, or a frame above the cleared level.
        """
        if self.box is None or self.solved is None:
            raise ExposureError("steered frames: expected the clearance of check_exposure_steered(), got another one")
        if poses is not None and not self.box.inside(poses, self.solved).all():
            raise ExposureError("steered frames: expected poses in the box that was checked, got one outside")
        own = replace(frames, array=self.array)
        own = own if self.factor == 1 else _weakened(own, self.factor, self.exposure.profile.name)
        if own.level.max(initial=0.0) > self.level + 1e-9:
            raise ExposureError(
                f"steered frames: expected at most {self.level:g} of full drive, got {own.level.max():g}"
            )
        if not self.gated or not own.level.any():
            return own
        answered = max(0.0, self.exposure.sound_excess) if self.outcome == "overridden" else 0.0
        played = replace(own, level=actual_level(own.level))
        # One frame of each millisecond is measured, and those between if the bound for them exceeds the profile.
        excess = exposure_excess(
            played, self.exposure.profile, self.exposure.airs, steps=self.steps, stride=max(1, round(1e-3 * own.rate))
        )
        loud = (excess := excess + self.louder - answered) > 0
        if not loud.any():
            return own
        # Rounded down to the firmware's steps; a tenth of a decibel covers the rounding of the search.
        factors = np.where(loud, 10 ** (-(excess + 0.1) / 20), 1.0)
        quiet = _strongest_below(own.level * (factors if own.level.ndim == 1 else factors[:, None]))
        return replace(own, level=np.where(loud if own.level.ndim == 1 else loud[:, None], quiet, own.level))

    def verdict(self) -> str:
        """Outcome and reason in one line; for an attenuated drive also whether it can be felt."""
        felt = felt_pressure_text(self.exposure) if self.outcome == "attenuated" else ""
        return f"{self.outcome}: {self.exposure.verdict()}" + (f"; {felt}" if felt else "")

    def __repr__(self) -> str:
        what = f"frames to come up to level {self.level:.3g}" if self.drive is None else f"{self.drive.frames} frames"
        answers = f", {self.by[:40]} is responsible" if self.by else ""
        return f"<ExposureClearance of {what}, {self.repeats} times on {self.array.name[:40]}: {self.outcome}{answers}>"


def felt_pressure_text(found: Exposure) -> str:
    """One line if a drive cannot be felt on the palm; empty if it may be felt.

    A modulated pressure has an amplitude of at most half its peak. It cannot be felt below the detection threshold at
    the most sensitive frequency of the skin (`SkinModel`; nominal, people differ by 10 dB).
    """
    just = 2 * SkinModel().pressure_just_felt
    if found.pressure >= just:
        return ""
    return f"nothing will be felt: at most {found.pressure:.2g} Pa on the palm, where {just:.2g} Pa are just felt"


def measure_exposure(
    drive: Drive,
    array: TransducerArray,
    profile: ExposureProfile,
    *,
    repeats: int = 1,
    steps: int = PHASE_STEPS,
    room: Medium | None = None,
    heat: Callable[[Drive], tuple[Array, float]] | tuple[Array, float] | None = None,
    **when: Any,
) -> Exposure:
    """Exposure on a given array; the source strength and air that the drive's file states are ignored.

    Computed for the range of air in the room (`airs_of_room`); the loudest counts. Levels and phases are rounded to the
    firmware's steps.

    `repeats` is the number of consecutive repeats, 1 or more, `steps` that of phase steps per turn of the device,
    `room` as in `ExposureChoices`; `heat` returns duty and warming, given the drive as it is played; `earlier`, `ends`
    and `alone` are those of `exposure`. Raises MismatchError if the drive is for another array, InputError if its speed
    of sound is outside the range of air.
    """
    _check_drive(drive, array)
    own = replace(drive, array=array, level=each_frame(drive.level, actual_level))
    airs = airs_of_room(room, profile.places, array)
    found = heat(own) if callable(heat) else heat
    return exposure(own, profile, repeats=repeats, acoustics=airs, steps=steps, heat=found, **when)


def _check_drive(drive: Drive, array: TransducerArray) -> None:
    drive.acoustics.medium.check_speed()
    if not array.same_as(drive.array):
        raise MismatchError(
            f"drive: expected one for {array.name} ({array.count} transducers), got one for "
            f"{drive.array.name} ({drive.array.count} transducers); solve the target again for this array"
        )


def check_exposure(
    drive: Drive, device: ArrayInfo, choices: ExposureChoices, *, repeats: int = 1, endless: bool = False
) -> ExposureClearance:
    """Check a drive against a profile before it is played.

    The array is that of the device that will play the drive; the source strength and air stored in a file are ignored.
    `choices` holds the profile, the air in the room, and the action if a drive exceeds the profile; `repeats` is the
    number of consecutive repeats, 1 or more; a drive that is played again until a stop is `endless`, and its heat that
    of a minute. Raises MismatchError if the drive is for another array, ExposureError if
    it exceeds the profile and there is no override, InputError if `repeats` is below 1.
    """
    _check_repeats(repeats)
    drive = with_checked_reading(drive)
    passes = _passes(drive, repeats, endless)
    found = _measured(drive, device, choices, passes)
    own = replace(drive, array=device.array)
    outcome, factor = _decide(found, device, choices)
    while outcome == "attenuated" and found.excess > 0:
        own = _weakened(replace(drive, array=device.array), factor, choices.profile.name)
        found = _measured(own, device, choices, passes)
        # Rounding the level of each transducer changes the pattern, and can make it louder at a place.
        factor *= 10 ** (-(max(found.excess, 0) + 0.1) / 20)
    return _clearance(device, choices, found, outcome, drive=own, repeats=repeats)


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
        _check_repeats(repeats)
        self._device, self._choices, self._repeats = device, choices, repeats
        self._level_steps = None if first.level.ndim == 1 else 255.0
        level = ArrivingFrames((frames, *first.level.shape[1:]), steps=self._level_steps)
        self.phase = ArrivingFrames((frames, device.array.count), steps=_TURN)
        """The phases that passed; its `there` is that of the stream."""
        self._level = level
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
        _check_drive(part, self._device.array)
        phase = phase_bytes(part, 1)[:, 0]
        level = part.level if self._level_steps is None else intensity_bytes(part, 1)[:, 0]
        scaled = level if self._level_steps is None else level / self._level_steps
        # The steps are checked that will sound.
        own = replace(part, phase=phase / _TURN, level=scaled)
        known = self._followed_by(own, done)
        heat = self._heat.add(replace(known, level=each_frame(known.level, actual_level)))
        earlier, ends = min(done, self._beside), known.frames == len(self.phase)
        found = self._part(known, np.arange(done - earlier, known.frames), heat, earlier=earlier, ends=ends)
        if ends and self._repeats > 1:
            # The first frames sound beside the last ones, at the end of the drive.
            around = np.arange(-self._beside, self._beside) % known.frames
            again = self._part(known, around, heat, earlier=self._beside, ends=False)
            found = replace(found, level=np.concatenate([found.level[:-1], [np.maximum(found.level[-1], again.peak)]]))
        if found.excess > 0:
            _decide(_joined([*self._measured, found]), self._device, self._choices)
        # Phases come last: with them a frame is there.
        self._level.append(level)
        self.phase.append(phase)
        self._measured.append(found)

    def fail(self, error: BaseException) -> None:
        """End with an error, which every later read of the drive raises."""
        self._level.fail(error)
        self.phase.fail(error)

    def _followed_by(self, part: Drive, done: int) -> Drive:
        """The frames that passed, followed by a part."""
        phase, level = self.phase[:done], self._level[:done]
        phase, level = concatenate_lazy([phase, part.phase]), concatenate_lazy([level, part.level])
        return replace(part, phase=phase, level=level)

    def _part(self, known: Drive, frames: NDArray[np.intp], heat: tuple[Array, float], **when: Any) -> Exposure:
        """Exposure to some frames; the heat is that of all."""
        some = replace(known, phase=np.asarray(known.phase[frames]), level=np.asarray(known.level[frames]))
        found = _measured(some, self._device, self._choices, 1, heat=heat, **when)
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
        outcome, _ = _decide(found, self._device, self._choices)
        # Later parts may exceed the profile, for which the person is responsible from the beginning.
        outcome = outcome if self._choices.override is None else "overridden"
        return _clearance(self._device, self._choices, found, outcome, repeats=self._repeats, **rest)


def _joined(parts: list[Exposure]) -> Exposure:
    """Exposure of consecutive parts of a drive, the last of which has the heat of all."""
    return replace(
        parts[-1],
        level=np.concatenate([each.level for each in parts]),
        air=np.concatenate([each.air for each in parts]),
        nonlinearity=max(each.nonlinearity for each in parts),
        pressure=max(each.pressure for each in parts),
    )


def check_exposure_steered(
    drive: Drive,
    device: ArrayInfo,
    choices: ExposureChoices,
    *,
    box: PoseBox,
    solved: Array,
    samples: Drive,
    repeats: int = 1,
    endless: bool = False,
) -> ExposureClearance:
    """Check a drive whose frames will be steered to the poses of a box while it plays.

    The drive is measured as it was solved, and `samples` alone: some of its frames, steered to poses of the box. Every
    frame is measured again once it was steered, by `ExposureClearance.steered`, before it sounds. The heat is that of
    the drive as it was solved.

    `box` are the admitted poses around the `solved` centre of the palm, shape (3,), in m. The other parameters and
    errors are those of `check_exposure`.
    """
    _check_repeats(repeats)
    own = _measured(drive, device, choices, _passes(drive, repeats, endless))
    louder = max(0.0, own.sound_excess - _measured(drive, device, choices, 1, alone=True).sound_excess)
    others = _measured(samples, device, choices, 1, alone=True)
    found = replace(
        own,
        level=np.concatenate([own.level, others.level + UNSAMPLED + louder]),
        air=np.concatenate([own.air, others.air]),
        pressure=max(own.pressure, others.pressure),
    )
    outcome, factor = _decide(found, device, choices)
    most = np.array([drive.level.max(initial=0.0)])
    loudest = np.rint(255 * (most if factor == 1 else _strongest_below(most * factor))).astype(np.uint8)
    # A level between two steps is played as the nearest one.
    level = float(np.max([loudest / 255, amplitude_of(loudest), most if factor == 1 else 0 * most]))
    # The clearance states what will be played; no factor ends above the limit for its last bit.
    found = found if factor == 1 else found.weakened(min(factor * (1 - 1e-9), level / float(most[0])))
    cleared = _clearance(device, choices, found, outcome, level=level, factor=factor)
    return replace(cleared, box=box, solved=solved, louder=louder, steps=device.steps_a_turn, _key=_KEY)


def check_exposure_level(
    level: float, device: ArrayInfo, choices: ExposureChoices, *, rate: float
) -> ExposureClearance:
    """Check the worst case of a level, for frames that are computed during playback.

    In the worst case all transducers are in phase at a place. This is far above the needs of a target, so that a
    cleared level is safe for any frames.

    `level` is the maximum drive of any transducer, above 0 to 1, and `rate` in frames per second; `device` and
    `choices` are as in `check_exposure`. With `attenuate`, the level is lowered until the worst case meets the profile.
    Raises ExposureError if the worst case exceeds the profile and there is no override, InputError if the level is out
    of range.
    """
    if not 0 < level <= 1:
        raise InputError(f"level: expected above 0 and at most 1 of full drive, got {level:g}")
    airs = airs_of_room(choices.room, choices.profile.places, device.array)
    found = greatest_exposure(device.array, level, choices.profile, rate=rate, airs=airs)
    outcome, factor = _decide(found, device, choices)
    if outcome == "attenuated":
        level *= factor
        found = greatest_exposure(device.array, level, choices.profile, rate=rate, airs=airs)
    return _clearance(device, choices, found, outcome, level=level)


def _measured(drive: Drive, device: ArrayInfo, choices: ExposureChoices, repeats: int, **rest: Any) -> Exposure:
    """Exposure on the device's array, in the air of the room."""
    return measure_exposure(
        drive, device.array, choices.profile, repeats=repeats, steps=device.steps_a_turn, room=choices.room, **rest
    )


def _passes(drive: Drive, repeats: int, endless: bool) -> int:
    """Number of passes whose heat counts: those of a minute, over which heat is averaged, if they never end."""
    return max(repeats, ceil(MINUTE * drive.rate / drive.frames)) if endless else repeats


def _check_repeats(repeats: int) -> None:
    if repeats < 1:
        raise InputError(f"expected 1 repeat or more, got {repeats}")


def _clearance(
    device: ArrayInfo,
    choices: ExposureChoices,
    found: Exposure,
    outcome: Outcome,
    *,
    drive: Drive | None = None,
    **rest: Any,
) -> ExposureClearance:
    named = (choices.override or "").strip()
    return ExposureClearance(
        drive=drive,
        array=device.array,
        exposure=found,
        outcome=outcome,
        by=named if outcome == "overridden" else "",
        named=named,
        gated=device.gated,
        _key=_KEY,
        **rest,
    )


def _decide(found: Exposure, device: ArrayInfo, choices: ExposureChoices) -> tuple[Outcome, float]:
    """Outcome for this exposure, and the attenuation factor."""
    if found.excess <= 0:
        return "kept", 1.0
    if choices.attenuate:
        return "attenuated", 10 ** (-found.excess / 20)
    overridden = choices.override is not None
    if overridden and found.excess <= choices.up_to:
        return "overridden", 1.0
    if not device.gated:
        return "exceeded", 1.0
    if overridden:
        raise ExposureError(
            f"exposure: {found.verdict()}; expected at most {choices.up_to:.1f} dB above it, for which "
            f"{choices.override} is responsible; stop it, and check the exposure of the louder drive"
        )
    raise ExposureError(
        f"exposure: {found.verdict()}; weaken it with --attenuate ({-found.excess:.1f} dB{_not_felt_note(found)}), "
        "take another --profile, or take responsibility with --override-exposure NAME and ear protection for everyone "
        "in the room"
    )


def _not_felt_note(found: Exposure) -> str:
    """A note if nothing can be felt after attenuation: radiation pressure is proportional to sound pressure squared."""
    weakened = replace(found, pressure=found.pressure * 10 ** (-found.excess / 10))
    return ", and nothing will be felt" if felt_pressure_text(weakened) else ""


def _weakened(drive: Drive, factor: float, profile: str) -> Drive:

    def weakened(level: Array) -> Array:
        return _strongest_below(level * factor)

    provenance = drive.provenance.then("attenuate", {"factor": factor, "profile": profile})
    return replace(drive, level=each_frame(drive.level, weakened), provenance=provenance)


def _strongest_below(level: Array) -> Array:
    """The highest intensities of the firmware whose level is at most this one."""
    steps = np.arange(256, dtype=np.uint8)
    strength = np.maximum(steps / 255, amplitude_of(steps))
    return np.maximum(np.searchsorted(strength, level, side="right") - 1, 0) / 255


def with_checked_reading(drive: Drive) -> Drive:
    """A drive whose lazy frames raise ExposureError if a second reading differs, as when the file was changed."""
    held = (drive.phase, drive.level)
    phase, level = (_checked_reading(each) if isinstance(each, LazyFrames) else each for each in held)
    return replace(drive, phase=phase, level=level) if any(isinstance(each, LazyFrames) for each in held) else drive


def _checked_reading(lazy: LazyFrames) -> Array:
    prints: dict[int, bytes] = {}

    def make(first: int, last: int) -> Array:
        frames = lazy.read(first, last)
        if prints.setdefault(first, digest := hashlib.sha256(frames.tobytes()).digest()) != digest:
            raise ExposureError(
                f"frames: expected {first} to {last - 1} as they were checked, got others; the file was changed, "
                "check it again"
            )
        return frames

    # Lazy frames are typed as the array that they represent.
    return cast("Array", cached_blocks(make, lazy.shape, size=512))
