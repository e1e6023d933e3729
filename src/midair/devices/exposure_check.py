"""Safety as a type: nothing that can sound takes a bare drive, and only this file makes what it takes.

`check_exposure` measures the exposure of people to a drive, with the array of the device that will play it, before any
sound. Its result, an `ExposureClearance`, is the only thing that `ArrayDevice.play` accepts.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import InitVar, dataclass, field, replace
from typing import Any, Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from midair.devices.frame_bytes import PHASE_STEPS, amplitude_of, loudest_of
from midair.errors import DeviceStateError, ExposureError, InputError, MismatchError
from midair.evaluate import SkinModel
from midair.lazy_frames import LazyFrames, cached_blocks, each_frame
from midair.model import Drive, Medium, TransducerArray
from midair.physics import Exposure, ExposureProfile, airs_of_room, exposure, greatest_exposure

Array = NDArray[np.float64]

Outcome = Literal["kept", "attenuated", "overridden", "exceeded"]
"""Within the limits; weakened until it was; a person answers for it; above them where no sound can come out."""

_ONLY_HERE = object()  # What an Admission is made with: no other file has it.


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureChoices:
    """What a drive may expose people to, and what is done with one that exceeds it; passed whole, never in parts.

    Attributes
    ----------
    profile : ExposureProfile
        That every drive must keep.
    attenuate : bool
        Whether to weaken a drive that is too strong, all frames alike, until it keeps the profile.
    override : str or None
        Who answers for playing it all the same.
    room : Medium or None
        The air of the room, stated by a person or measured: 2 degrees and 20 % of humidity around it count. From 14
        to 30 degrees count if None; a default, or the air that a file claims, must not stand here.

    Raises
    ------
    InputError
        If an override has no name.
    """

    profile: ExposureProfile
    attenuate: bool = False
    override: str | None = None
    room: Medium | None = None

    def __post_init__(self) -> None:
        if self.override is not None and not self.override.strip():
            raise InputError("--override-exposure: expected the name of the person who answers for it, got none")


class ArrayInfo(Protocol):
    """What `check_exposure` needs to know of a device; see `ArrayDevice`."""

    name: str
    array: TransducerArray
    gated: bool
    steps_a_turn: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExposureClearance:
    """What may be played, on which array, how often. Only the functions of this module make one.

    Attributes
    ----------
    drive : Drive or None
        What to play; weaker than the one that came if it was attenuated. None where the frames come later: `frames`
        admits them.
    array : TransducerArray
        The device's, with which the exposure was worked out.
    exposure : Exposure
        Of what is to be played.
    outcome : {"kept", "attenuated", "overridden", "exceeded"}
        "exceeded" only where no sound can come out.
    by : str
        Who answers for an override.
    repeats : int
        How often it may be played, one time after the other.
    gated : bool
        Whether it was made for a device that can be heard.
    level : float
        Highest level of frames that come later, 0 to 1.
    factor : float
        By which frames that come later are weakened.
    """

    drive: Drive | None
    array: TransducerArray
    exposure: Exposure
    outcome: Outcome
    by: str = ""
    repeats: int = 1
    gated: bool = True
    level: float = 0.0
    factor: float = 1.0
    _known: frozenset[bytes] = field(default=frozenset(), repr=False)
    _key: InitVar[object] = None

    def __post_init__(self, _key: object) -> None:
        if _key is not _ONLY_HERE:
            raise DeviceStateError("admission: expected one from admit(), which checks exposure; it cannot be made up")

    def check_array(self, device: ArrayInfo) -> None:
        """Refuse a device that it was not admitted on.

        Raises
        ------
        MismatchError
            If the device's array is another, or louder, than the one that was measured.
        DeviceStateError
            If it was admitted where nothing sounds and the device can be heard.
        """
        if not self.array.same_as(device.array) or device.array.pressure > self.array.pressure * (1 + 1e-9):
            raise MismatchError(f"{device.name}: expected what was admitted for it, got it for {self.array.name}")
        if device.gated and not self.gated:
            raise DeviceStateError(
                f"{device.name}: expected what was admitted on a device that can be heard; admit again"
            )

    def check_for(self, device: ArrayInfo) -> Drive:
        """The drive, for a device that it was admitted on.

        Raises
        ------
        MismatchError
            If the device's array is another, or louder, than the one that was measured.
        DeviceStateError
            If it was admitted where nothing sounds and the device can be heard, or its frames are yet to come.
        """
        self.check_array(device)
        if self.drive is None:
            raise DeviceStateError(f"{device.name}: expected frames to play, got an admission for frames to come")
        return self.drive

    @property
    def strongest(self) -> int:
        """The strongest intensity byte, 0 to 255, of frames that come later: none that is above `level` in any way."""
        steps = np.arange(256, dtype=np.uint8)
        # To a hair, so that a level that is a step is that step.
        return int(np.flatnonzero(np.maximum(steps / 255, amplitude_of(steps)) <= self.level * (1 + 1e-9))[-1])

    def frames(self, drive: Drive) -> "ExposureClearance":
        """Frames that were read or made after the admission, as something that may be played.

        Parameters
        ----------
        drive : Drive
            One of the parts that `check_exposure_parts` measured, or frames within the level of `check_exposure_level`.

        Raises
        ------
        MismatchError
            If they are for another array, or of another rate.
        ExposureError
            If they were not measured, or are stronger than what was admitted.
        """
        if not self.array.same_as(drive.array):
            raise MismatchError(f"frames: expected some for {self.array.name}, got some for {drive.array.name}")
        if drive.rate != self.exposure.rate:
            raise MismatchError(f"frames: expected some at {self.exposure.rate:g} Hz, got some at {drive.rate:g} Hz")
        if self._known and _fingerprint(drive) not in self._known:
            raise ExposureError("frames: expected a part that was admitted, got one that was not; admit it again")
        # Half a step of the firmware's 255 is what rounding may add, and adds in the measure of the level too.
        if not self._known and drive.level.max(initial=0.0) > self.level + 1e-9:
            raise ExposureError(
                f"frames: expected a level of at most {self.level:g} of full drive, got {drive.level.max():g}"
            )
        own = replace(drive, array=self.array)
        weaker = own if self.factor == 1 else _weakened(own, self.factor, self.exposure.profile.name)
        return replace(self, drive=weaker, _key=_ONLY_HERE)

    def verdict(self) -> str:
        """One line: what becomes of it, why, and whether anybody would feel it."""
        felt = felt_pressure_text(self.exposure) if self.outcome == "attenuated" else ""
        return f"{self.outcome}: {self.exposure.verdict()}" + (f"; {felt}" if felt else "")

    def __repr__(self) -> str:
        what = f"frames to come up to level {self.level:.3g}" if self.drive is None else f"{self.drive.frames} frames"
        answers = f", {self.by[:40]} answers for it" if self.by else ""
        return f"<Admission of {what}, {self.repeats} times on {self.array.name[:40]}: {self.outcome}{answers}>"


def felt_pressure_text(found: Exposure) -> str:
    """What a palm would make of a drive in one line; nothing where it may be felt.

    A pressure that comes and goes swings by half its peak around its mean at most. Where that is less than what is just
    felt at the frequency that skin feels best (`SkinModel`; nominal, people differ by 10 dB), nothing will be felt.

    Parameters
    ----------
    found : Exposure
        Of the drive.
    """
    just = 2 * SkinModel().pressure_just_felt
    if found.pressure >= just:
        return ""
    return f"nothing will be felt: at most {found.pressure:.2g} Pa on the palm, where {just:.2g} Pa are just felt"


def measure(
    drive: Drive,
    array: TransducerArray,
    profile: ExposureProfile,
    *,
    repeats: int = 1,
    steps: int = PHASE_STEPS,
    room: Medium | None = None,
) -> Exposure:
    """Exposure on an array that is known, whatever the drive's file says of its strength and of the air.

    Measured in the airs that the room may have (`airs_of_room`); the loudest counts. Levels and phases count as the
    firmware's steps make them.

    Parameters
    ----------
    drive : Drive
        To be played.
    array : TransducerArray
        That is to play it.
    profile : ExposureProfile
        Places and limits.
    repeats : int
        How often it is to be played, 1 or more.
    steps : int
        Of a turn, to which what plays rounds phases.
    room : Medium, optional
        As in `ExposureChoices`.

    Raises
    ------
    MismatchError
        If the drive is for another array.
    InputError
        If it was solved for an air of which the speed of sound cannot be that of a room.
    """
    drive.acoustics.medium.check_speed()
    if not array.same_as(drive.array):
        raise MismatchError(
            f"drive: expected one for {array.name} ({array.count} transducers), got one for "
            f"{drive.array.name} ({drive.array.count} transducers); solve the target again for this array"
        )
    own = replace(drive, array=array, level=each_frame(drive.level, loudest_of))
    airs = airs_of_room(room, profile.places, array)
    return exposure(own, profile, repeats=repeats, acoustics=airs, steps=steps)


def check_exposure(drive: Drive, device: ArrayInfo, choices: ExposureChoices, *, repeats: int = 1) -> ExposureClearance:
    """Check a drive against a profile before it is played.

    Parameters
    ----------
    drive : Drive
        To be played.
    device : ArrayDevice
        That is to play it. Its own array is measured: what a file says of a transducer's strength and of the air
        counts for nothing.
    choices : ExposureChoices
        The profile, the air of the room, and what to do with a drive that exceeds the profile.
    repeats : int
        How often it is to be played, 1 or more.

    Raises
    ------
    MismatchError
        If the drive is for another array.
    ExposureError
        If the drive exceeds the profile and nobody answers for it.
    InputError
        If there is less than one repeat.
    """
    _check_repeats(repeats)
    drive = sealed(drive)
    found = _measured(drive, device, choices, repeats)
    own = replace(drive, array=device.array)
    outcome, factor = _decide(found, device, choices)
    if outcome == "attenuated":
        own = _weakened(own, factor, choices.profile.name)
        found = _measured(own, device, choices, repeats)
    return _admission(device, choices, found, outcome, drive=own, repeats=repeats)


def check_exposure_parts(
    parts: Iterable[Drive], device: ArrayInfo, choices: ExposureChoices, *, repeats: int = 1
) -> ExposureClearance:
    """Check a drive that is read in parts, so that none of it need be in memory at once.

    Every part is measured here; `ExposureClearance.frames` then admits those parts, read once more, and no others.

    Parameters
    ----------
    parts : iterable of Drive
        One after another, of one rate.
    device, choices, repeats
        As in `check_exposure`.

    Raises
    ------
    MismatchError
        If a part is for another array, or of another rate.
    ExposureError
        If one exceeds the profile and nobody answers for it.
    InputError
        If there are no parts.
    """
    _check_repeats(repeats)
    known: set[bytes] = set()
    measured: list[Exposure] = []
    for part in parts:
        if measured and part.rate != measured[0].rate:
            raise MismatchError(f"parts: expected all at {measured[0].rate:g} Hz, got one at {part.rate:g} Hz")
        known.add(_fingerprint(part))
        measured.append(_measured(part, device, choices, repeats))
    if not measured:
        raise InputError("parts: expected one or more, got none")
    found = replace(
        measured[0],
        level=np.concatenate([each.level for each in measured]),
        air=np.concatenate([each.air for each in measured]),
        nonlinearity=max(each.nonlinearity for each in measured),
        pressure=max(each.pressure for each in measured),
    )
    outcome, factor = _decide(found, device, choices)
    return _admission(device, choices, found, outcome, repeats=repeats, factor=factor, _known=frozenset(known))


def check_exposure_level(
    level: float, device: ArrayInfo, choices: ExposureChoices, *, rate: float
) -> ExposureClearance:
    """Check the most that frames of a level can do, for frames that are made while the array plays.

    The worst that any phases can do at a place is all transducers in step there. It is far above what a target needs,
    so that a level this admits is safe whatever comes.

    Parameters
    ----------
    level : float
        Highest drive of any transducer, above 0 to 1.
    device, choices
        As in `check_exposure`. With `attenuate`, the level is lowered until the worst keeps the profile.
    rate : float
        Frames per second, in Hz.

    Raises
    ------
    ExposureError
        If the worst exceeds the profile and nobody answers for it.
    InputError
        If the level is out of range.
    """
    if not 0 < level <= 1:
        raise InputError(f"level: expected above 0 and at most 1 of full drive, got {level:g}")
    airs = airs_of_room(choices.room, choices.profile.places, device.array)
    found = greatest_exposure(device.array, level, choices.profile, rate=rate, airs=airs)
    outcome, factor = _decide(found, device, choices)
    if outcome == "attenuated":
        level *= factor
        found = greatest_exposure(device.array, level, choices.profile, rate=rate, airs=airs)
    return _admission(device, choices, found, outcome, level=level)


def _measured(drive: Drive, device: ArrayInfo, choices: ExposureChoices, repeats: int) -> Exposure:
    """Exposure on the array of the device that is to play, in the room's air."""
    return measure(drive, device.array, choices.profile, repeats=repeats, steps=device.steps_a_turn, room=choices.room)


def _check_repeats(repeats: int) -> None:
    if repeats < 1:
        raise InputError(f"expected 1 repeat or more, got {repeats}")


def _admission(
    device: ArrayInfo,
    choices: ExposureChoices,
    found: Exposure,
    outcome: Outcome,
    *,
    drive: Drive | None = None,
    **rest: Any,
) -> ExposureClearance:
    return ExposureClearance(
        drive=drive,
        array=device.array,
        exposure=found,
        outcome=outcome,
        by=_who(outcome, choices),
        gated=device.gated,
        _key=_ONLY_HERE,
        **rest,
    )


def _decide(found: Exposure, device: ArrayInfo, choices: ExposureChoices) -> tuple[Outcome, float]:
    """What becomes of a drive with this exposure, and the factor that weakens it."""
    if found.excess <= 0:
        return "kept", 1.0
    if choices.attenuate:
        return "attenuated", 10 ** (-found.excess / 20)
    if choices.override is not None:
        return "overridden", 1.0
    if not device.gated:
        return "exceeded", 1.0
    raise ExposureError(
        f"exposure: {found.verdict()}; weaken it with --attenuate ({-found.excess:.1f} dB{_and_then(found)}), "
        "take another --profile, or answer for it with --override-exposure NAME and ear protection for everyone in "
        "the room"
    )


def _and_then(found: Exposure) -> str:
    """What would be left to feel after attenuation: radiation pressure goes with the square of sound pressure."""
    weakened = replace(found, pressure=found.pressure * 10 ** (-found.excess / 10))
    return ", and nothing will be felt" if felt_pressure_text(weakened) else ""


def _who(outcome: Outcome, choices: ExposureChoices) -> str:
    return choices.override.strip() if outcome == "overridden" and choices.override else ""


def _weakened(drive: Drive, factor: float, profile: str) -> Drive:
    """The drive at the strongest intensities that a firmware has and that keep the profile."""
    steps = np.arange(256, dtype=np.uint8)
    strength = np.maximum(steps / 255, amplitude_of(steps))

    def weakened(level: Array) -> Array:
        return np.maximum(np.searchsorted(strength, level * factor, side="right") - 1, 0) / 255

    provenance = drive.provenance.then("attenuate", {"factor": factor, "profile": profile})
    return replace(drive, level=each_frame(drive.level, weakened), provenance=provenance)


def _fingerprint(drive: Drive) -> bytes:
    """Of what sounds: phases and levels, to the last bit."""
    return hashlib.sha256(drive.phase.tobytes() + drive.level.tobytes()).digest()


def sealed(drive: Drive) -> Drive:
    """A drive whose reels give the same frames whenever they are read: what was measured is what is played.

    A file may change between the two, by accident or not. What was read first is what counts.

    Raises
    ------
    ExposureError
        When frames are read that are others than they were before.
    """
    held = (drive.phase, drive.level)
    phase, level = (_sealed(each) if isinstance(each, LazyFrames) else each for each in held)
    return replace(drive, phase=phase, level=level) if any(isinstance(each, LazyFrames) for each in held) else drive


def _sealed(reel: LazyFrames) -> Array:
    prints: dict[int, bytes] = {}

    def make(first: int, last: int) -> Array:
        frames = reel.read(first, last)
        if prints.setdefault(first, digest := hashlib.sha256(frames.tobytes()).digest()) != digest:
            raise ExposureError(
                f"frames: expected {first} to {last - 1} as they were admitted, got others; the file was changed, "
                "admit it again"
            )
        return frames

    # To a type checker a reel is the array that it stands for.
    return cast("Array", cached_blocks(make, reel.shape, size=512))
