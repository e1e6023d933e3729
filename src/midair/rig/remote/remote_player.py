"""The thread that plays: silent frames until a play is triggered, then its frames while the client's lease lasts."""

import os
import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import ceil
from pathlib import Path
from typing import Any, Self

import numpy as np

from midair.array_types import Array
from midair.devices import (
    TICK,
    BeginOrder,
    ImmediateArray,
    Put,
    RawPose,
    Tracker,
    divider,
    intensity_bytes,
    phase_bytes,
)
from midair.devices import check_exposure as check
from midair.errors import InputError, SilentFramesError
from midair.files import load_solution
from midair.model import Acoustics, Drive, Medium, Provenance
from midair.patterns import PATTERN_ENDINGS, draw, drawn_settings, load_pattern
from midair.physics import Exposure
from midair.rig.names import TRACKERS, array_calibration_for
from midair.rig.play_lease import LeaseToken, PlayLease
from midair.rig.playing import Follower, FollowRules, PlaySettings, clear_followed, grid_of, wait_until

LEASE = 0.5
"""Time in s after which the array is silent without a sign of life of the client in control."""
REPEATED, FADE, WORD = 60.0, 0.005, 0.008
"""Times in s: for which the check repeats a drive, of a change of the level from 0 to 1, between silent frames."""


class PalmMessages:
    """The palm as clients report it, as the source of a tracker."""

    host_clock = True

    def __init__(self) -> None:
        self._poses = queue.SimpleQueue[RawPose | str]()
        self.open = self.close = lambda: None
        self.add = self._poses.put

    def pull(self, wait: float) -> list[RawPose | str]:
        """Poses since the last call."""
        with suppress(queue.Empty):
            return [self._poses.get(timeout=wait or 1e-6)]
        return []


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Loaded:
    drive: Drive
    exposure: Exposure
    about: dict[str, Any]
    put: Put
    log: Callable[[str, str], None]
    report: dict[str, Any]
    follower: Follower | None
    frames: Callable[[slice, Array], tuple[Any, Any]]
    """Phases (frame, unit, transducer) and intensities (frame,) of frames that sound at times of this computer."""


class RemotePlayer:
    """Plays loaded drives inside `drives_to_come` of an array, in a thread of its own until it is left.

    `ended` is called when the thread ends; leaving raises its error.
    """

    def __init__(self, array: ImmediateArray, settings: PlaySettings, quiet: Put, begin: BeginOrder) -> None:
        self._array, self._settings, self._begin = array, settings, begin
        silence = np.zeros((array.placement.units, array.array.count // array.placement.units), np.uint8)
        self._quiet = partial(self._put, quiet, silence, 0)
        self.permit, self._token = PlayLease(), LeaseToken(number=0, stops=0)
        self.loaded: dict[str, _Loaded] = {}
        self.level, self.late, self.failsafe = 1.0, 0, 0
        self.palm, self.silent = PalmMessages(), threading.Event()
        self._tracker = Tracker(self.palm, name="palm", options=TRACKERS["osc"]())
        self._triggers = queue.SimpleQueue[tuple[_Loaded, int, LeaseToken] | None]()
        self._now: tuple[_Loaded, int, float, int] | None = None
        self._thread, self._error = threading.Thread(target=self._run, daemon=True), list[BaseException]()
        self.ended: Callable[[], object] = lambda: None

    def __enter__(self) -> Self:
        self._tracker.open()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.permit.stop()
        self._triggers.put(None)
        self._thread.join()
        self._tracker.close()
        for error in self._error:
            raise error

    def load(self, path: Path, duration: float | None, follow: bool) -> dict[str, Any]:
        """Read or draw a file, check its exposure and log the order; slow, for a thread of its own."""
        if hasattr(os, "sched_setscheduler"):
            with suppress(OSError):  # the check must not hold up the thread that plays
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        array, how, units = self._array, self._settings, self._array.placement.units
        drive = self._drawn(path, duration) if path.suffix in PATTERN_ENDINGS else load_solution(path).drive
        if not 100 <= drive.rate <= 8000 or drive.level.ndim > 1:
            expected = "100 to 8000 frames a second with one level for all transducers"
            raise InputError(f"{path.name}: expected {expected}, got {drive.rate:g} Hz, {drive.level.shape} levels")
        if follow:
            grid = grid_of(drive)
            admission = clear_followed(drive, array, replace(how, steer_only=True), grid)
            follower = Follower(self._tracker, drive, grid, rules=FollowRules(fit=False), report=lambda _: None)
        else:
            admission = check(drive, array, how.exposure, repeats=ceil(REPEATED * drive.rate / drive.frames))
            drive, follower = admission.check_for(array), None
        phases, intensities = np.asarray(phase_bytes(drive, units)), np.asarray(intensity_bytes(drive, 1))

        def frames(part: slice, times: Array) -> tuple[Any, Any]:
            if follower is None:
                return phases[part], intensities[part]
            steered = admission.steered(*follower.steered(part, times))
            return phase_bytes(steered, units), intensity_bytes(steered, 1)

        report: dict[str, Any] = {"plays": 0, "duration": 0.0}
        about = {"file": path.name, "seconds": drive.frames / drive.rate, "rate_hz": drive.rate, "follow": follow}
        about["exposure"] = admission.verdict()
        put, log = self._begin(admission, path, report)
        made: dict[str, Any] = {"put": put, "log": log, "report": report, "follower": follower, "frames": frames}
        self.loaded[path.name] = _Loaded(drive=drive, exposure=admission.exposure, about=about, **made)
        return about

    def _drawn(self, path: Path, duration: float | None) -> Drive:
        pattern, acoustics = load_pattern(path), Acoustics(medium=self._settings.exposure.room or Medium.at())
        known, foci = array_calibration_for(self._settings.device), pattern.foci(duration)
        array = self._array.array if known is None else known.known.applied(self._array.array)
        life = drawn_settings(foci, acoustics).noted(Provenance(source=path.name))
        return replace(draw(foci, array, acoustics=acoustics).drive, provenance=life)

    def trigger(self, file: str, repeats: int) -> _Loaded:
        """Play a loaded file now."""
        if file not in self.loaded:
            raise InputError(f"file: expected one that is loaded, {sorted(self.loaded)}, got {file[:60]!r}; load it")
        if self.permit.refusal(self._token) is not None:
            self._token = self.permit.arm(lasts=LEASE)
        self.silent.clear()
        self._triggers.put((self.loaded[file], repeats, self._token))
        return self.loaded[file]

    def state(self) -> dict[str, Any]:
        """What plays now, its level, and the levels at the places of the exposure profile in dB."""
        state: dict[str, Any] = {"playing": None, "seconds": 0.0, "drive": 0.0, "places_db": {}}
        if (now := self._now) is not None:
            loaded, number, gain, intensity = now
            levels = loaded.exposure.level[number % loaded.drive.frames] + 20 * np.log10(max(gain, 1e-9))
            places = zip(loaded.exposure.profile.places, levels, strict=True)
            state["places_db"] = {place.name: round(float(each), 1) for place, each in places if each > 0}
            state |= {"playing": loaded.about["file"], "seconds": number / loaded.drive.rate, "drive": intensity / 255}
        return state | {"level": self.level, "late": self.late, "failsafe": self.failsafe}

    def _run(self) -> None:
        try:
            while (trigger := self._next()) is not None:
                self._play(*trigger)
        except BaseException as error:  # noqa: BLE001  # raised on leaving
            self._error.append(error)
        self._now = None
        self.silent.set()
        self.ended()

    def _next(self) -> tuple[_Loaded, int, LeaseToken] | None:
        """The next trigger, after silent frames until there is one; None at the end."""
        while True:
            if self._triggers.empty():
                self._now = None
                self.silent.set()
            try:
                return self._triggers.get(timeout=WORD)
            except queue.Empty:
                self._quiet(self._array.units.now() + round(1e9 * self._array.hold))

    def _put(self, put: Put, *frame: Any) -> None:
        try:
            put(*frame)
        except SilentFramesError:  # the program was held up for 50 ms; the next frame sounds again
            self.failsafe += 1
            self._array.resume()

    def _play(self, loaded: _Loaded, repeats: int, token: LeaseToken) -> None:
        """Play to the end, or until the next trigger or the end of the lease."""
        units, rate, frames = self._array.units, loaded.drive.rate, loaded.drive.frames
        period, ahead, step = divider(rate) * TICK, round(1e9 * min(self._array.hold, 5 / rate)), 1 / (rate * FADE)
        soon, early, block = min(ahead, 500_000), 1_000_000, max(1, round(FollowRules().block * rate))
        if loaded.follower is not None:
            loaded.follower.fall_silent()
            early *= 4
        self.silent.clear()
        loaded.report["plays"] += 1
        first = -(-(units.now() + ahead + early) // period) * period
        number, begin, end, gain, phases, intensities = 0, 0, 0, self.level, np.zeros(0), np.zeros(0)
        while not repeats or number < repeats * frames:
            if self.permit.refusal(token) is not None:
                return self._array.silence()
            if not self._triggers.empty():
                return None
            if (missed := -(-(units.now() + soon - first - number * period) // period)) > 0:
                # The units keep the frame before.
                self.late, number = self.late + missed, number + missed
                continue
            if number >= end:
                at = number % frames
                begin, end = number, number + min(block, frames - at)
                clock = first + time.monotonic_ns() - units.now()
                times = np.asarray(1e-9 * (clock + np.arange(begin, end) * period), np.float64)
                phases, intensities = loaded.frames(slice(at, at + end - begin), times)
            wait_until(units, first + number * period - ahead)
            gain += min(max(self.level - gain, -step), step)
            intensity = int(intensities[number - begin] * gain)
            self._put(loaded.put, phases[number - begin], intensity, first + number * period)
            self._now = loaded, number, gain, intensity
            number += 1
            loaded.report["duration"] += 1 / rate
        wait_until(units, first + number * period - ahead)
        return self._quiet(first + number * period)
