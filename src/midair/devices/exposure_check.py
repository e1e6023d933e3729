"""The exposure check, which is mandatory before playback.

`check_exposure` computes the exposure of people to a drive on the array that will play it, before any sound. It returns
an `ExposureClearance`, the only type that `ArrayDevice.play` accepts, and only `cleared` of this module creates one.
"""

import hashlib
from collections.abc import Callable
from dataclasses import InitVar, dataclass, replace
from math import ceil
from typing import Any, Literal, Protocol, TypeVar, cast

import numpy as np

from midair.array_types import Array
from midair.devices.frame_bytes import PHASE_STEPS, actual_level, amplitude_of, intensity_bytes
from midair.errors import DeviceStateError, ExposureError, InputError, MismatchError
from midair.evaluate import HARDLY_FELT
from midair.model import Drive, Medium, TransducerArray
from midair.physics import MINUTE, Exposure, ExposureProfile, airs_of_room, exposure, greatest_exposure
from midair.streaming import LazyFrames, cached_blocks, each_frame

Outcome = Literal["kept", "attenuated", "overridden", "exceeded"]
"""Within the limits; attenuated to meet them; above them under the responsibility of a named person; above them on a
device without sound."""

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

    drive: Drive | None = None
    """The drive to play, after any attenuation; None if the frames come later."""
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

    def check_level(self, frames: Drive) -> None:
        """Raise ExposureError if frames that come later exceed the cleared level."""
        # The firmware rounds to 255 steps; the check of the level includes this rounding.
        if (level := frames.level.max(initial=0.0)) > self.level + 1e-9:
            raise ExposureError(f"frames: expected a level of at most {self.level:g} of full drive, got {level:g}")

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

    A modulated pressure has an amplitude of at most half its peak.
    """
    least = 2 * HARDLY_FELT
    if found.pressure >= least:
        return ""
    return f"nothing will be felt: {found.pressure:.2g} of the {least:.2g} Pa that one of 20 people feels"


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
    check_drive(drive, array)
    own = replace(drive, array=array, level=each_frame(drive.level, actual_level))
    airs = airs_of_room(room, profile.places, array)
    found = heat(own) if callable(heat) else heat
    return exposure(own, profile, repeats=repeats, acoustics=airs, steps=steps, heat=found, **when)


def check_drive(drive: Drive, array: TransducerArray) -> None:
    """Raise MismatchError if a drive is for another array, InputError if its air has no possible speed of sound."""
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
    drive = with_checked_reading(drive)
    passes = passes_counted(drive, repeats, endless=endless)
    found = measured_on(drive, device, choices, passes)
    own = replace(drive, array=device.array)
    outcome, factor = decide(found, device, choices)
    while outcome == "attenuated" and found.excess > 0:
        own = weakened(replace(drive, array=device.array), factor, choices.profile.name)
        found = measured_on(own, device, choices, passes)
        # Rounding the level of each transducer changes the pattern, and can make it louder at a place.
        factor *= 10 ** (-(max(found.excess, 0) + 0.1) / 20)
    return cleared(ExposureClearance, device, choices, found, outcome, drive=own, repeats=repeats)


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
    outcome, factor = decide(found, device, choices)
    if outcome == "attenuated":
        level *= factor
        found = greatest_exposure(device.array, level, choices.profile, rate=rate, airs=airs)
    return cleared(ExposureClearance, device, choices, found, outcome, level=level)


def measured_on(drive: Drive, device: ArrayInfo, choices: ExposureChoices, repeats: int, **rest: Any) -> Exposure:
    """Exposure on the device's array, in the air of the room."""
    return measure_exposure(
        drive, device.array, choices.profile, repeats=repeats, steps=device.steps_a_turn, room=choices.room, **rest
    )


def passes_counted(drive: Drive, repeats: int, *, endless: bool) -> int:
    """Number of passes that are measured: if they never end, those of a minute, over which heat is averaged, and two or
    more, since the end of one sounds with the begin of the next. Raises InputError below 1 repeat.
    """
    if repeats < 1:
        raise InputError(f"expected 1 repeat or more, got {repeats}")
    return max(repeats, 2, ceil(MINUTE * drive.rate / drive.frames)) if endless else repeats


Cleared = TypeVar("Cleared", bound=ExposureClearance)


def cleared(
    kind: type[Cleared], device: ArrayInfo, choices: ExposureChoices, found: Exposure, outcome: Outcome, **rest: Any
) -> Cleared:
    """The permission that follows from an outcome of `decide`; `rest` are fields of its kind."""
    named = (choices.override or "").strip()
    who = {"by": named if outcome == "overridden" else "", "named": named, "gated": device.gated}
    return kind(array=device.array, exposure=found, outcome=outcome, **who, **rest, _key=_KEY)


def decide(found: Exposure, device: ArrayInfo, choices: ExposureChoices) -> tuple[Outcome, float]:
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
    left = replace(found, pressure=found.pressure * 10 ** (-found.excess / 10))  # it goes with the square of sound
    unfelt = ", and nothing will be felt" if felt_pressure_text(left) else ""
    advice = (
        f"--attenuate plays it weaker ({-found.excess:.1f} dB{unfelt}), --ear-protection counts what everyone in the "
        "room wears, --override-exposure NAME takes responsibility"
    )
    if overridden:
        advice = (
            f"expected at most {choices.up_to:.1f} dB above it, for which {choices.override} is responsible; stop it, "
            "and check the exposure of the louder drive"
        )
    refused = ExposureError(f"exposure: {found.verdict()}; {advice}")
    refused.exposure = found
    raise refused


def weakened(drive: Drive, factor: float, profile: str) -> Drive:
    """The drive at a part of its level, rounded down to the firmware's steps."""
    provenance = drive.provenance.then("attenuate", {"factor": factor, "profile": profile})
    return replace(
        drive, level=each_frame(drive.level, lambda level: strongest_below(level * factor)), provenance=provenance
    )


def strongest_below(level: Array) -> Array:
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

    # Up to 64 MB stay in memory, so that a short drive is read once, checked and played.
    kept = min(16, max(3, 2**26 * len(lazy) // (512 * max(lazy.nbytes, 1))))
    # Lazy frames are typed as the array that they represent.
    return cast("Array", cached_blocks(make, lazy.shape, size=512, kept=kept))
