"""The exposure check, which is mandatory before playback.

`check_exposure` computes the exposure of people to a drive on the array that will play it, before any sound. It returns
an `ExposureClearance`, the only type that `ArrayDevice.play` accepts, and only this module can create one.
"""

import hashlib
import threading
import time
from dataclasses import InitVar, dataclass, replace
from typing import Any, Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from midair.devices.frame_bytes import PHASE_STEPS, actual_level, amplitude_of, phase_bytes
from midair.errors import DeviceStateError, ExposureError, InputError, MismatchError
from midair.evaluate import SkinModel
from midair.model import Drive, Medium, TransducerArray
from midair.physics import (
    Exposure,
    ExposureProfile,
    HeatHistory,
    StreamedExposure,
    airs_of_room,
    bin_frames,
    exposure,
    greatest_exposure,
)
from midair.streaming import LazyFrames, TempFrames, cached_blocks, each_frame

Array = NDArray[np.float64]

Outcome = Literal["kept", "attenuated", "overridden", "exceeded"]
"""Within the limits; attenuated to meet them; above them under the responsibility of a named person; above them on a
device without sound."""

_KEY = object()  # Key to the constructor of ExposureClearance, private to this module.


@dataclass(frozen=True, slots=True, kw_only=True)
class ExposureChoices:
    """Exposure limits, the action if a drive exceeds them, and the air; passed as a whole.

    Raises
    ------
    InputError
        If an override has no name.
    """

    profile: ExposureProfile
    """Limits for every drive."""
    attenuate: bool = False
    """Whether to attenuate a drive that exceeds the profile, all frames by the same factor, until it meets it."""
    override: str | None = None
    """Name of the person who takes responsibility for playing a drive that exceeds the profile."""
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
    """The drive to play, after any attenuation; None if the frames come later."""
    array: TransducerArray
    """The device's array, for which the exposure was computed."""
    exposure: Exposure
    """Exposure to what will be played."""
    outcome: Outcome
    """Outcome of the check; "exceeded" only on a device without sound."""
    by: str = ""
    """Name of the person responsible for an override."""
    repeats: int = 1
    """Number of consecutive repeats."""
    gated: bool = True
    """True if it was issued for a gated device, which can emit sound."""
    level: float = 0.0
    """Maximum level of frames that come later, 0 to 1."""
    stream: "ExposureStream | None" = None
    """The stream that checks the frames of the drive while they play; None if all were checked."""
    _key: InitVar[object] = None

    def __post_init__(self, _key: object) -> None:
        if _key is not _KEY:
            raise DeviceStateError("clearance: expected the result of check_exposure(); it cannot be made up")

    def check_array(self, device: ArrayInfo) -> None:
        """Raise unless it was issued for this device.

        Raises
        ------
        MismatchError
            If the device's array differs from the checked one, or is louder.
        DeviceStateError
            If it was issued for a device without sound and this device can emit sound.
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

        Raises
        ------
        MismatchError, DeviceStateError
            As in `check_array`; DeviceStateError also if its frames come later.
        """
        self.check_array(device)
        if self.drive is None:
            raise DeviceStateError(f"{device.name}: expected frames to play, got a clearance for frames to come")
        return self.drive

    @property
    def strongest(self) -> int:
        """Largest intensity byte, 0 to 255, for frames that come later; neither nominal nor actual level exceeds
        `level`.
        """
        steps = np.arange(256, dtype=np.uint8)
        # The tolerance keeps a level that equals a step from being rounded down.
        return int(np.flatnonzero(np.maximum(steps / 255, amplitude_of(steps)) <= self.level * (1 + 1e-9))[-1])

    def verdict(self) -> str:
        """Outcome and reason in one line; for an attenuated drive also whether it can be felt."""
        if self.stream is not None:
            return self.stream.verdict()
        felt = felt_pressure_text(self.exposure) if self.outcome == "attenuated" else ""
        return f"{self.outcome}: {self.exposure.verdict()}" + (f"; {felt}" if felt else "")

    @property
    def decided(self) -> Outcome:
        """Outcome of all frames that were checked, also while the drive played."""
        return self.outcome if self.stream is None else self.stream.decided

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
    heat: HeatHistory | None = None,
) -> Exposure:
    """Exposure on a given array; the source strength and air that the drive's file states are ignored.

    Computed for the range of air in the room (`airs_of_room`); the loudest counts. Levels and phases are rounded to the
    firmware's steps.

    Parameters
    ----------
    repeats : int
        Number of consecutive repeats, 1 or more.
    steps : int
        Number of phase steps per turn of the device.
    room : Medium, optional
        As in `ExposureChoices`.
    heat : HeatHistory, optional
        Heat of the parts before, which this part is added to.

    Raises
    ------
    MismatchError
        If the drive is for another array.
    InputError
        If the drive's speed of sound is outside the range of air.
    """
    drive.acoustics.medium.check_speed()
    if not array.same_as(drive.array):
        raise MismatchError(
            f"drive: expected one for {array.name} ({array.count} transducers), got one for "
            f"{drive.array.name} ({drive.array.count} transducers); solve the target again for this array"
        )
    own = replace(drive, array=array, level=each_frame(drive.level, actual_level))
    airs = airs_of_room(room, profile.places, array)
    return exposure(own, profile, repeats=repeats, acoustics=airs, steps=steps, heat=heat)


def check_exposure(drive: Drive, device: ArrayInfo, choices: ExposureChoices, *, repeats: int = 1) -> ExposureClearance:
    """Check a drive against a profile before it is played.

    Parameters
    ----------
    device : ArrayDevice
        The device that will play it. Its own array is used; the source strength and air stored in a file are ignored.
    choices : ExposureChoices
        The profile, the air in the room, and the action if a drive exceeds the profile.
    repeats : int
        Number of consecutive repeats, 1 or more.

    Raises
    ------
    MismatchError
        If the drive is for another array.
    ExposureError
        If the drive exceeds the profile and there is no override.
    InputError
        If `repeats` is below 1.
    """
    _check_repeats(repeats)
    drive = with_checked_reading(drive)
    found = _measured(drive, device, choices, repeats)
    own = replace(drive, array=device.array)
    outcome, factor = _decide(found, device, choices)
    while outcome == "attenuated" and found.excess > 0:
        own = _weakened(replace(drive, array=device.array), factor, choices.profile.name)
        found = _measured(own, device, choices, repeats)
        # Rounding the level of each transducer changes the pattern, and can make it louder at a place.
        factor *= 10 ** (-(max(found.excess, 0) + 0.1) / 20)
    return _clearance(device, choices, found, outcome, drive=own, repeats=repeats)


def check_exposure_level(
    level: float, device: ArrayInfo, choices: ExposureChoices, *, rate: float
) -> ExposureClearance:
    """Check the worst case of a level, for frames that are computed during playback.

    In the worst case all transducers are in phase at a place. This is far above the needs of a target, so that a
    cleared level is safe for any frames.

    Parameters
    ----------
    level : float
        Maximum drive of any transducer, above 0 to 1.
    device, choices
        As in `check_exposure`. With `attenuate`, the level is lowered until the worst case meets the profile.
    rate : float
        Frames per second, in Hz.

    Raises
    ------
    ExposureError
        If the worst case exceeds the profile and there is no override.
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
    return _clearance(device, choices, found, outcome, level=level)


class ExposureStream:
    """Checks the parts of a drive, in order, while earlier ones play; an array can read only frames that passed.

    `add` and `end` are called by the thread that computes the parts; frames wait on the disk, phases in the steps of
    the device. The first part that exceeds the profile ends the stream with ExposureError: frames before it remain
    readable. With `attenuate` or repeats, which need all frames, nothing can be read before the end.

    Parameters
    ----------
    device, choices, repeats
        As in `check_exposure`.
    frames : int
        Number of frames of all parts.
    """

    MARGIN, SPARE = 1.15, 0.15
    """Factor on the measured time of a part, and time in s by which frames must come before they sound."""

    def __init__(self, device: ArrayInfo, choices: ExposureChoices, *, frames: int, repeats: int = 1) -> None:
        _check_repeats(repeats)
        self.frames, self.admitted, self.over = frames, 0, False
        self.exposure: StreamedExposure | None = None
        self._device, self._choices, self._repeats = device, choices, repeats
        self._waits_for_all = choices.attenuate or repeats > 1
        self._heat, self._changed, self._checking = HeatHistory(), threading.Condition(), threading.Lock()
        self._clearance: ExposureClearance | None = None
        self._error: BaseException | None = None
        self._rest: Drive | None = None
        self._spools: tuple[TempFrames, TempFrames] | None = None
        self._last, self._pace, self._rate = 0, 0.0, 1.0

    def prepare(self) -> None:
        """Compute once what the check of every part needs, for example while the first part is solved."""
        array = self._device.array
        silent = Drive(phase=np.zeros((1, array.count)), level=np.zeros(1), rate=1.0, array=array)
        with self._checking:
            _measured(silent, self._device, self._choices, 1)

    def add(self, part: Drive, *, took: float) -> None:
        """Check the next frames, which took this time in s to compute, and let the array read them.

        Raises
        ------
        ExposureError
            If they exceed the profile without an override; MismatchError as `check_exposure`.
        """
        if self._rest is not None:
            whole = (np.concatenate([getattr(self._rest, name), getattr(part, name)]) for name in ("phase", "level"))
            part = replace(part, **dict(zip(("phase", "level"), whole, strict=True)))
        # Whole bins of the heat history.
        ready = (
            part.frames
            if part.frames + self._seen == self.frames
            else part.frames - part.frames % bin_frames(part.rate)
        )
        self._rest = _frames_of(part, ready, part.frames) if ready < part.frames else None
        if ready:
            self._admit(_frames_of(part, 0, ready), took)

    def end(self, error: BaseException | None = None) -> None:
        """End the stream; an error is raised to the reader of any frame that has not come."""
        if error is None and self._waits_for_all and self._spools is not None:
            try:
                whole = check_exposure(self._drive(wait=False), self._device, self._choices, repeats=self._repeats)
            except InputError as wrong:
                error = wrong
            else:
                self._clearance = whole
        with self._changed:
            if not self.over:
                self.over, self._error = True, error
            self._changed.notify_all()

    def check_loop(self, passes: int) -> None:
        """Raise ExposureError if a loop of all frames heats more than the profile allows."""
        if self.exposure is not None:
            duty, warming = self._heat.repeated(passes)
            _decide(replace(self.exposure, duty=duty, warming=warming), self._device, self._choices)

    def check(self) -> None:
        """Raise the error with which the stream ended, if any."""
        if self._error is not None:
            raise self._error

    def clearance(self) -> ExposureClearance:
        """Wait for the first part, or for all where needed, and return the clearance of all frames to come.

        Raises the error with which the stream ended before.
        """
        with self._changed:
            while self._clearance is None and not self.over:
                # A wait without a limit could not be interrupted on Windows.
                self._changed.wait(0.1)
            if self._clearance is None:
                raise self._error or InputError("stream: expected one part or more, got none")
            return self._clearance

    def begun(self) -> Drive:
        """The frames that were admitted so far."""
        return _frames_of(self._drive(wait=False), 0, self.admitted)

    def delay(self, played: int = 0) -> float:
        """Time in s until playback can continue at a frame without a gap, at the speed of the last part."""
        with self._changed:
            left, period = self.frames - self.admitted, 1 / self._rate
            pace, last = self.MARGIN * self._pace, min(left, self._last)
            ahead = (self.admitted - played) * period - self.SPARE
            if self.over or left <= 0:
                return 0.0
            # The next part must come while the frames before it play, and the last part too.
            return max(0.0, last * pace - ahead, left * pace - ahead - (left - last) * period)

    @property
    def speed(self) -> float:
        """Computed and checked time of sound per time, of the last part; above 1 the machine keeps up."""
        return 1 / (self._pace * self._rate)

    def verdict(self) -> str:
        """Outcome of the frames that were checked so far, in one line."""
        if self.exposure is None:
            return "checked part by part, ahead of the sound"
        said = "" if self.over else f"first {self.exposure.duration:.2g} s "
        rest = "" if self.over else "; the rest is checked ahead of its sound"
        return f"{said}{self.decided}: {self.exposure.verdict()}{rest}"

    @property
    def decided(self) -> Outcome:
        """Outcome for the frames that were checked so far."""
        return "kept" if self.exposure is None else _decide(self.exposure, self._device, self._choices)[0]

    @property
    def _seen(self) -> int:
        return self._spools[0].frames if self._spools else 0

    def _admit(self, part: Drive, took: float) -> None:
        device, choices = self._device, self._choices
        with self._checking:
            began = time.monotonic()
            if not self._waits_for_all:
                found = measure_exposure(
                    part,
                    device.array,
                    choices.profile,
                    steps=device.steps_a_turn,
                    room=choices.room,
                    heat=self._heat,
                )
                self.exposure = StreamedExposure.joined(self.exposure, found)
                _decide(self.exposure, device, choices)
        in_bytes = device.steps_a_turn == PHASE_STEPS
        if self._spools is None:
            self._template, self._rate = part, part.rate
            phases = TempFrames(part.array.count, dtype="u1" if in_bytes else "f8")
            self._spools = phases, TempFrames(*part.level.shape[1:])
        stored: Any = phase_bytes(part, 1)[:, 0] if in_bytes else part.phase
        with self._changed:
            self._spools[0].append(stored)
            self._spools[1].append(part.level)
            self.admitted += part.frames
            self._last, self._pace = part.frames, (took + time.monotonic() - began) / part.frames
            if self._clearance is None and not self._waits_for_all:
                self._clearance = self._cleared()
            self._changed.notify_all()

    def _cleared(self) -> ExposureClearance:
        """Clearance of the frames to come; its exposure is the most that can pass."""
        device, choices = self._device, self._choices
        airs = airs_of_room(choices.room, choices.profile.places, device.array)
        most = greatest_exposure(device.array, 1.0, choices.profile, rate=self._rate, airs=airs)
        outcome: Outcome = "kept" if choices.override is None else "overridden"
        if choices.override is None and device.gated:
            limits = [place.limit if place.enforced else np.inf for place in choices.profile.places]
            most = replace(
                most, level=np.minimum(most.level, limits), warming=min(most.warming, choices.profile.warming)
            )
        return _clearance(device, choices, most, outcome, drive=self._drive(wait=True), level=1.0, stream=self)

    def _drive(self, *, wait: bool) -> Drive:
        """All frames as lazy frames, of which reading waits until they have come."""
        phases, levels = self._spools or (TempFrames(1), TempFrames())
        in_bytes = self._device.steps_a_turn == PHASE_STEPS

        def read(spool: TempFrames, first: int, last: int) -> Array:
            with self._changed:
                while wait and self.admitted < last and not self.over:
                    self._changed.wait(0.1)
                if self.admitted < last:
                    raise self._error or DeviceStateError(
                        f"frames: expected {last}, the stream ended at {self.admitted}"
                    )
                return spool.read(first, last)

        def phase(first: int, last: int) -> Array:
            steps = read(phases, first, last)
            return steps * (2 * np.pi / PHASE_STEPS) if in_bytes else steps

        total, count = (self.frames if wait else self.admitted), self._template.array.count
        return replace(
            self._template,
            array=self._device.array,
            phase=cast("Array", LazyFrames(phase, (total, count))),
            level=cast("Array", LazyFrames(lambda first, last: read(levels, first, last), (total, *levels.shape))),
        )


def _frames_of(drive: Drive, first: int, last: int) -> Drive:
    return replace(drive, phase=drive.phase[first:last], level=drive.level[first:last])


def _measured(drive: Drive, device: ArrayInfo, choices: ExposureChoices, repeats: int) -> Exposure:
    """Exposure on the device's array, in the air of the room."""
    return measure_exposure(
        drive, device.array, choices.profile, repeats=repeats, steps=device.steps_a_turn, room=choices.room
    )


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
    return ExposureClearance(
        drive=drive,
        array=device.array,
        exposure=found,
        outcome=outcome,
        by=_responsible_person(outcome, choices),
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
    if choices.override is not None:
        return "overridden", 1.0
    if not device.gated:
        return "exceeded", 1.0
    raise ExposureError(
        f"exposure: {found.verdict()}; weaken it with --attenuate ({-found.excess:.1f} dB{_not_felt_note(found)}), "
        "take another --profile, or take responsibility with --override-exposure NAME and ear protection for everyone "
        "in the room"
    )


def _not_felt_note(found: Exposure) -> str:
    """A note if nothing can be felt after attenuation: radiation pressure is proportional to sound pressure squared."""
    weakened = replace(found, pressure=found.pressure * 10 ** (-found.excess / 10))
    return ", and nothing will be felt" if felt_pressure_text(weakened) else ""


def _responsible_person(outcome: Outcome, choices: ExposureChoices) -> str:
    return choices.override.strip() if outcome == "overridden" and choices.override else ""


def _weakened(drive: Drive, factor: float, profile: str) -> Drive:
    """The drive at the strongest intensities of the firmware that meet the profile."""
    steps = np.arange(256, dtype=np.uint8)
    strength = np.maximum(steps / 255, amplitude_of(steps))

    def weakened(level: Array) -> Array:
        return np.maximum(np.searchsorted(strength, level * factor, side="right") - 1, 0) / 255

    provenance = drive.provenance.then("attenuate", {"factor": factor, "profile": profile})
    return replace(drive, level=each_frame(drive.level, weakened), provenance=provenance)


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
