"""Steer every frame of a drive to the palm that a tracker reports, and fade it when the palm is not sure."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from midair.array_types import Array
from midair.devices import (
    TICK,
    ArrayInfo,
    ImmediateArray,
    ImmediateUnits,
    PlayReport,
    PosePredictor,
    SteeredClearance,
    Tracker,
    autd3_immediate,
    check_exposure_steered,
    divider,
    intensity_bytes,
    phase_bytes,
    signals_end_the_program,
    virtual_immediate,
)
from midair.errors import InputError, SilentFramesError, UnknownDeviceError
from midair.model import ControlGrid, Drive, PalmPath, Progress
from midair.physics import PalmFit, PoseBox, aims_of, middle_of, pose_of, steering_phase
from midair.rig.names.sensor_names import open_tracker
from midair.rig.playing.play_settings import PlaySettings
from midair.settings import Settings
from midair.solvers import one_blas_thread


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowRules:
    """When a palm is followed, and how fast sound fades when it is not."""

    box: PoseBox = field(default_factory=PoseBox)
    """Poses that are followed."""
    confidence: float = 0.3
    """Lowest confidence of the tracker."""
    patience: float = 0.1
    """Longest time since the newest pose, in s."""
    fade: float = 0.007
    """Time in s over which sound fades, and rises again."""
    block: float = 8e-3
    """Time in s for which frames are steered at once; phases are linear within it."""
    fit: bool = True
    """Whether phases are also fitted to the palm, a thousand times a second; phases are linear between."""


class Follower:
    """Steers frames to the palm that a tracker predicts for the moments at which they sound.

    The tracker is open, in array coordinates; the drive was solved for a palm above the middle of the grid; `report`
    gets one line when the sound fades and when it returns. InputError if the drive has a level for each transducer.
    """

    def __init__(
        self,
        tracker: Tracker,
        drive: Drive,
        grid: ControlGrid,
        *,
        rules: FollowRules | None = None,
        predictor: PosePredictor | None = None,
        report: Callable[[str], object] = print,
    ) -> None:
        if drive.level.ndim > 1:
            raise InputError(
                "--follow: expected one level for all transducers, got one for each; solve again with equal amplitudes"
            )
        self.rules, self.solved = rules or FollowRules(), middle_of(grid)
        self._tracker, self._drive, self._report = tracker, drive, report
        self._predictor = predictor or PosePredictor()
        self._aims = aims_of(drive, grid)
        self.newest, self._confidence = -np.inf, 0.0
        self._gain, self._audible, self._inside = 0.0, False, False
        self._pose: PalmPath | None = None
        self._phase = np.zeros(drive.array.count)
        self._fit = PalmFit(drive.array, drive.acoustics, grid) if self.rules.fit else None
        self._fitted = np.full(drive.array.count, self._fit is not None, np.complex64)

    def steered(self, frames: slice, times: Array) -> tuple[Drive, PalmPath | None]:
        """Consecutive frames, steered to the palm at their times on the tracker's clock, and the pose at their end.

        Where the palm is not followed the pose is the last one that was, None before the first.
        """
        pose = self._predicted(times[-1:])
        followed = pose is not None and self._follows(pose, times[-1])
        if followed != self._audible:
            self._audible = followed
            self._report(f"follow: {'the palm is followed' if followed else self._reason(times[-1])}")
        phase, level = self._drive.phase[frames], self._drive.level[frames] * (gain := self._gains(len(times)))
        if pose is None or (not followed and self._pose is None):
            return replace(self._drive, phase=phase, level=0 * level), None
        begin = self._phase
        if followed:
            self._pose = pose
            aim, medium = self._aims[frames.stop - 1], self._drive.acoustics.medium
            self._phase = steering_phase(self._drive.array, medium, self.solved, pose, aim=aim)[0]
            begin = begin if gain[0] > 1 / (self._drive.rate * self.rules.fade) else self._phase
        # Linear from the end of the block before, so that there is no step.
        share = (np.arange(len(times)) + 1.0)[:, None] / len(times)
        turned = share * (self._phase - begin)
        turned += begin
        turned += phase
        if self._fit is not None:
            turned += self._beside(self._fit, phase)
        elif self._fitted.any():
            # The fit was left out; its phases fade within this block.
            turned += (1 - share) * np.angle(self._fitted)
            self._fitted[:] = 0
        return replace(self._drive, phase=turned, level=level), self._pose

    def _beside(self, fit: PalmFit, phase: Array) -> Array:
        """Phases of the fit for a block of steered frames, linear between those that are fitted."""
        if self._pose is not None:
            fit.move(self._pose)
        stride = max(1, round(1e-3 * self._drive.rate))
        at = np.arange(len(phase))[::-stride][::-1]
        # The fit is that of the pose at the end of the block, to which all of its frames are steered here.
        factors = np.concatenate([self._fitted[None], fit(phase[at], phase[at] + self._phase)])
        steps = np.angle(factors[1:] * factors[:-1].conj())
        begin = np.angle(self._fitted)
        angles = begin + np.concatenate([0 * begin[None], np.cumsum(steps, axis=0)])
        self._fitted = factors[-1]
        before = np.searchsorted(at, np.arange(len(phase)))
        ends = np.concatenate([[-1], at])
        share = (np.arange(len(phase)) - ends[before]) / (ends[before + 1] - ends[before])
        return angles[before] + share[:, None] * (angles[before + 1] - angles[before])

    def steer_alone_if_slow(self, clearance: SteeredClearance) -> None:
        """Leave out the fit if this computer needs more than two thirds of the time of a block for it and the check."""
        if self._fit is None:
            return
        frames = slice(0, min(max(1, round(self.rules.block * self._drive.rate)), self._drive.frames))
        part = replace(self._drive, phase=self._drive.phase[frames], level=self._drive.level[frames])
        still = PalmPath.from_rows(np.concatenate([[0.0], self.solved, [0, 0, -1, 0, 1, 0, 1]])[None])
        spent = []
        for _ in range(3):
            begin = time.perf_counter()
            self._pose, self._fit.pose = still, None
            self._beside(self._fit, part.phase)
            clearance.steered(part, still)
            spent.append(time.perf_counter() - begin)
        self._pose, self._fit.pose, self._fitted = None, None, np.ones_like(self._fitted)
        if min(spent) > self.rules.block * 2 / 3:
            self.steer_alone()

    def steer_alone(self) -> None:
        """Leave out the fit from the next block on, since it takes too long."""
        if self._fit is not None:
            self._fit = None
            self._report("follow: this computer is too slow to fit frames to the tilt of the palm; they are steered")

    def _predicted(self, at: Array) -> PalmPath | None:
        new = self._tracker.poses(self.newest)
        if new is not None:
            self._predictor.add(new)
            # The prediction is smooth, and follows a hand that leaves only after some time.
            self._inside = bool(self.rules.box.inside(new, self.solved)[-1])
            self.newest, self._confidence = float(new.time[-1]), float(new.confidence[-1])
        for line in self._tracker.events():
            self._report(line)
        return self._predictor.at(at) if np.isfinite(self.newest) else None

    def _follows(self, pose: PalmPath, at: float) -> bool:
        sure = self._confidence >= self.rules.confidence and at - self.newest <= self.rules.patience
        return sure and self._inside and not self._tracker.frozen and bool(self.rules.box.inside(pose, self.solved)[0])

    def fall_silent(self) -> None:
        """Rise from silence with the next frames, since the array is silent."""
        self._gain = 0.0

    def _gains(self, count: int) -> Array:
        """Gain of each frame, 0 to 1."""
        step = (1 if self._audible else -1) / (self._drive.rate * self.rules.fade)
        gains = np.clip(self._gain + step * np.arange(1, count + 1), 0.0, 1.0, dtype=np.float64)
        self._gain = float(gains[-1])
        return gains

    def _reason(self, now: float) -> str:
        if now - self.newest > self.rules.patience:
            return f"no pose for {1e3 * self.rules.patience:.0f} ms, silent"
        if self._tracker.frozen:
            return f"the pose has not changed for {1e3 * self._tracker.options.freeze:.0f} ms, silent"
        if self._confidence < self.rules.confidence:
            return f"confidence {self._confidence:.2f} of the pose, silent below {self.rules.confidence:g}"
        return "the palm left the box of admitted poses, silent"


TRIPS = 5
"""Number of times that the units' failsafe may act in a play; after one more it ends."""


def grid_of(drive: Drive) -> ControlGrid:
    """Control points that a drive was solved for. Raises InputError if it has no settings."""
    known = Settings.of(drive.provenance)
    if known is None:
        raise InputError("follow: expected a drive that states the settings of its solve, got none; solve it again")
    return known.target.grid


def tracker_name(name: str | None, latency: float | None) -> str:
    """Name of a tracker with its latency in s as an option."""
    if name is None or latency is None:
        return name or ""
    return f"{name}{'&' if '?' in name else '?'}latency_ms={1e3 * latency:g}"


def follow_simulated(
    drive: Drive,
    tracker: str,
    grid: ControlGrid,
    *,
    rules: FollowRules | None = None,
    repeats: int = 1,
    predictor: PosePredictor | None = None,
    report: Callable[[str], object] = print,
) -> Drive:
    """The drive as it would sound while it follows a tracker, whose time 0 is the first frame; for the virtual array.

    Poses are available after the latency of the tracker, on the clock of the simulation.
    """
    now = [0.0]

    def timed(line: str) -> None:
        report(f"{now[0]:.3f} s: {line}")

    with open_tracker(tracker, clock=lambda: now[0]) as opened:
        opened.begin(0.0)
        follower = Follower(opened, drive, grid, rules=rules, predictor=predictor, report=timed)
        block, parts = max(1, round(follower.rules.block * drive.rate)), []
        for turn in range(repeats):
            for first in range(0, drive.frames, block):
                frames = slice(first, min(first + block, drive.frames))
                times = (turn * drive.frames + np.arange(frames.start, frames.stop)) / drive.rate
                now[0] = float(times[0])
                parts.append(follower.steered(frames, times)[0])
    return replace(
        drive,
        phase=np.concatenate([part.phase for part in parts]),
        level=np.concatenate([part.level for part in parts]),
        provenance=drive.provenance.then("follow", {"tracker": tracker}),
    )


def immediate_array(settings: PlaySettings, rate: float, *, hold: float | None = None) -> ImmediateArray:
    """The array of the settings, not yet open, for single frames. Raises UnknownDeviceError if it has none."""
    kind, _, where = settings.device.partition(":")
    # Units queue seven frames.
    hold = hold or min(0.006, 5 / rate)
    if settings.device == "virtual":
        return virtual_immediate(settings.placement, hold=hold)
    if kind != "autd3":
        raise UnknownDeviceError(
            f"--device: expected virtual or autd3, autd3:INTERFACE, autd3:emulator, which accept single frames, got "
            f"{settings.device!r}"
        )
    if settings.palm_path is not None:
        raise InputError(
            f"--palm-path: expected --device virtual, got {settings.device}, above which a real palm moves"
        )
    return autd3_immediate(where or "auto", settings.placement, silencer=settings.silencer, rate=rate, hold=hold)


def clear_followed(
    drive: Drive,
    array: ArrayInfo,
    settings: PlaySettings,
    grid: ControlGrid,
    *,
    samples: int = 2048,
    seed: int = 0,
    endless: bool = False,
) -> SteeredClearance:
    """Check the exposure of a drive for the box of poses: as it was solved, and frames steered to random poses.

    An eighth of them are fitted, too. `endless` is that of `check_exposure`.
    """
    box, solved, rng = FollowRules().box, middle_of(grid), np.random.default_rng(seed)
    frames = np.sort(rng.integers(0, drive.frames, samples))
    down = np.array([0.0, 0.0, -1.0]) + np.tan(box.tilt) * rng.uniform(-0.7, 0.7, (samples, 3)) * [1, 1, 0]
    down = down / np.linalg.norm(down, axis=1, keepdims=True)
    turn = rng.uniform(0, 2 * np.pi, samples)
    level = np.stack([np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    ahead = level - (level * down).sum(axis=1, keepdims=True) * down
    ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    centre = solved + rng.uniform(-0.5, 0.5, (samples, 3)) * box.size
    poses = PalmPath.from_rows(
        np.column_stack([np.arange(samples, dtype=float), centre, down, ahead, np.ones(samples)])
    )
    aims = aims_of(drive, grid)[frames]
    some = replace(drive, phase=drive.phase[frames], level=drive.level[frames])
    added = steering_phase(array.array, drive.acoustics.medium, solved, poses, aim=aims)
    phase = some.phase + added
    # Every eighth one is fitted as well, which takes twenty times as long as the check of it.
    fit = PalmFit(array.array, drive.acoustics, grid)
    for number in range(0, 0 if settings.steer_only else samples, 8):
        fit.move(pose_of(poses, number))
        phase[number] += np.angle(fit(some.phase[[number]], phase[[number]])[0])
    steered = replace(some, phase=phase)
    return check_exposure_steered(
        drive,
        array,
        settings.exposure,
        box=box,
        solved=solved,
        samples=steered,
        repeats=settings.repeats,
        endless=endless,
    )


@one_blas_thread()
def play_followed(
    drive: Drive,
    array: ImmediateArray,
    tracker: Tracker,
    settings: PlaySettings,
    clearance: SteeredClearance,
    grid: ControlGrid,
    *,
    source: str | Path = "python",
    report: Callable[[str], object] = print,
    progress: Progress | None = None,
) -> tuple[PlayReport, tuple[float, float]]:
    """Play a drive on an open array, frame by frame, each steered to the palm at the moment it sounds.

    A frame that is not ready at its instant is not played; the units keep the one before it. Returns the report, and
    the time from the newest pose to the sending of a block of frames in s: median and 99 %; NaN without poses.
    """
    units, period = array.units, divider(drive.rate) * TICK
    rules = FollowRules(confidence=settings.confidence, fit=not settings.steer_only)
    follower = Follower(tracker, drive, grid, rules=rules, report=report)
    block, total = max(1, round(follower.rules.block * drive.rate)), drive.frames * settings.repeats
    ahead, before, reactions = round(array.hold * 1e9), units.counts(), list[float]()
    follower.steer_alone_if_slow(clearance)
    with signals_end_the_program(), array.frames_to_come(clearance, source=source, room=settings.exposure.room) as put:
        # The first block needs longer than the others.
        first = -(-(units.now() + round(settings.delay * 1e9) + 50_000_000) // period) * period
        offset = units.now() - time.monotonic_ns()
        tracker.begin((first - offset) * 1e-9)
        # Without a frame every 50 ms the units' failsafe acts.
        quiet, begin = np.zeros((array.placement.units, array.array.count // array.placement.units), np.uint8), 0
        trips = 0

        def play(phases: npt.NDArray[np.uint8], intensity: int, instant: int) -> None:
            nonlocal trips
            try:
                put(phases, intensity, instant)
            except SilentFramesError:
                # The program was held up for 50 ms.
                if (trips := trips + 1) > TRIPS:
                    raise
                report("follow: the failsafe silenced the units")
                array.resume()
                follower.fall_silent()

        while first - units.now() > 4 * ahead:
            play(quiet, 0, units.now() + ahead)
            time.sleep(0.01)
        slack = round(1e9 * follower.rules.block / 2)
        while begin < total:
            if (behind := units.now() + ahead - first - begin * period) > 0:
                # Go on with frames that can be in time, since steering those that are late would keep it late.
                missed = min(-(-(behind + slack) // period), total - begin)
                for _ in range(missed):
                    play(quiet, 0, 0)
                begin += missed
                continue
            at = begin % drive.frames
            numbers = begin + np.arange(min(block, drive.frames - at))
            # Clocks drift: 50 ppm are 1 ms in 20 s.
            offset = units.now() - time.monotonic_ns()
            wait_until(units, first + begin * period - ahead - slack)
            times = np.asarray((first + numbers * period - offset) * 1e-9, np.float64)
            part, poses = follower.steered(slice(at, at + len(numbers)), times)
            part = clearance.steered(part, poses)
            if units.now() > first + begin * period - ahead:
                follower.steer_alone()
            phases = phase_bytes(part, array.placement.units)
            intensities = intensity_bytes(part, array.placement.units)
            if np.isfinite(follower.newest):
                reactions.append(time.monotonic() - follower.newest)
            for number, phase, intensity in zip(numbers, phases, intensities, strict=True):
                instant = first + int(number) * period
                wait_until(units, instant - ahead)
                play(phase, int(intensity), instant)
            begin += len(numbers)
            if progress is not None:
                progress(begin, total)
        wait_until(units, first + total * period)
    told = {name: count - before[name] for name, count in units.counts().items()}
    late, lasts = told["late"] + told["crowded"], total * period / 1e9
    played = PlayReport(frames=total, duration=lasts, late=late, start=first, silencer=str(array.silencer))
    middle, worst = np.percentile(reactions, [50, 99]) if reactions else (np.nan, np.nan)
    return played, (float(middle), float(worst))


def wait_until(units: ImmediateUnits, instant: int) -> None:
    """Wait until an instant of the units' clock."""
    while (left := instant - units.now()) > 0:
        time.sleep(left * 1e-9)
