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
    ExposureClearance,
    ImmediateArray,
    Put,
    RawPose,
    Tracker,
    check_exposure,
    divider,
    intensity_bytes,
    phase_bytes,
)
from midair.errors import InputError, SilentFramesError
from midair.files import load_solution
from midair.model import Acoustics, Drive, Medium, Provenance
from midair.patterns import PATTERN_ENDINGS, draw, drawn_settings, load_pattern
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
    """A checked drive with its order in the log; bytes of phases (frame, unit, transducer) and intensities (frame,)."""

    file: str
    drive: Drive
    admission: ExposureClearance
    follower: Follower | None
    put: Put
    log: Callable[[str, str], None]
    report: dict[str, Any]
    phases: Any
    intensities: Any

    def described(self, trigger: str = "") -> dict[str, Any]:
        """Description for clients, after a trigger was logged."""
        if trigger:
            self.log("trigger", trigger)
        about = {"file": self.file, "seconds": self.drive.frames / self.drive.rate, "rate_hz": self.drive.rate}
        return about | {"follow": self.follower is not None, "exposure": self.admission.verdict()}

    def frames(self, first: int, times: Array) -> tuple[Any, Any]:
        """Phases and intensities of consecutive frames that sound at `times` of this computer's clock."""
        part = slice(first, first + len(times))
        if self.follower is None:
            return self.phases[part], self.intensities[part]
        steered = self.admission.steered(*self.follower.steered(part, times))
        return phase_bytes(steered, self.phases.shape[1]), intensity_bytes(steered, 1)


class RemotePlayer:
    """Plays loaded drives on an open array, in a thread of its own; a context manager, silent after leaving."""

    def __init__(self, array: ImmediateArray, settings: PlaySettings) -> None:
        self.array, self._settings, self._permit = array, settings, PlayLease()
        self._token, self._error = LeaseToken(number=0, stops=0), list[BaseException]()
        self.loaded: dict[str, _Loaded] = {}
        self.level, self.late, self.failsafe = 1.0, 0, 0
        self.palm, self.silent = PalmMessages(), threading.Event()
        self.ended: Callable[[], object] = lambda: None
        self._tracker = Tracker(self.palm, name="palm", options=TRACKERS["osc"]())
        self._triggers = queue.SimpleQueue[tuple[_Loaded, int, LeaseToken] | None]()
        self._ready, self._thread = threading.Event(), threading.Thread(target=self._run, name="remote", daemon=True)
        self._begin: BeginOrder | None = None
        self._quiet: Callable[[int], None] = lambda _: None
        self._now: tuple[_Loaded, int, float, int] | None = None

    def __enter__(self) -> Self:
        self._tracker.open()
        self._thread.start()
        self._ready.wait()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._triggers.put(None)
        self._thread.join()
        self._tracker.close()
        for error in self._error:
            raise error

    def load(self, path: Path, duration: float | None, follow: bool) -> dict[str, Any]:
        """Read or draw a file, check its exposure and log the order; slow, for a thread of its own."""
        if hasattr(os, "sched_setscheduler"):
            # The check must not hold up the thread that plays.
            with suppress(OSError):
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        array, choices, units = self.array, self._settings.exposure, self.array.placement.units
        drive = self._drawn(path, duration) if path.suffix in PATTERN_ENDINGS else load_solution(path).drive
        if not 100 <= drive.rate <= 8000 or drive.level.ndim > 1:
            expected = "100 to 8000 frames a second with one level for all transducers"
            raise InputError(f"{path.name}: expected {expected}, got {drive.rate:g} Hz, {drive.level.shape} levels")
        follower = None
        if follow:
            grid = grid_of(drive)
            admission = clear_followed(drive, array, replace(self._settings, steer_only=True), grid)
            follower = Follower(self._tracker, drive, grid, rules=FollowRules(fit=False), report=lambda _: None)
        else:
            admission = check_exposure(drive, array, choices, repeats=ceil(REPEATED * drive.rate / drive.frames))
            drive = admission.check_for(array)
        if self._begin is None:
            raise InputError("load: expected an array that is open, it was closed; start midair serve again")
        report: dict[str, Any] = {"plays": 0, "duration": 0.0}
        put, log = self._begin(admission, path, report)
        steps: Any = {
            "phases": np.asarray(phase_bytes(drive, units)),
            "intensities": np.asarray(intensity_bytes(drive, 1)),
        }
        about: Any = {"file": path.name, "drive": drive, "admission": admission, "follower": follower} | steps
        self.loaded[path.name] = loaded = _Loaded(put=put, log=log, report=report, **about)
        return loaded.described()

    def _drawn(self, path: Path, duration: float | None) -> Drive:
        pattern, acoustics = load_pattern(path), Acoustics(medium=self._settings.exposure.room or Medium.at())
        known, foci = array_calibration_for(self._settings.device), pattern.foci(duration)
        array = self.array.array if known is None else known.known.applied(self.array.array)
        life = drawn_settings(foci, acoustics).noted(Provenance(source=path.name))
        return replace(draw(foci, array, acoustics=acoustics).drive, provenance=life)

    def trigger(self, file: str, repeats: int) -> _Loaded:
        """Play a loaded file now."""
        if file not in self.loaded:
            raise InputError(f"file: expected one that is loaded, {sorted(self.loaded)}, got {file[:60]!r}; load it")
        if self._permit.refusal(self._token) is not None:
            self._token = self._permit.arm(lasts=LEASE)
        self.silent.clear()
        self._triggers.put((self.loaded[file], repeats, self._token))
        return self.loaded[file]

    def stop(self) -> None:
        """End the lease; `silent` is set when the array is silent."""
        self._permit.stop()

    def renew(self) -> None:
        """Renew the lease, if there is one."""
        if self._permit.armed:
            self._permit.renew(lasts=LEASE)

    def state(self) -> dict[str, Any]:
        """What plays now, its level, and the levels at the places of the exposure profile in dB."""
        state: dict[str, Any] = {"playing": None, "seconds": 0.0, "drive": 0.0, "places_db": {}}
        if (now := self._now) is not None:
            loaded, number, gain, intensity = now
            found = loaded.admission.exposure
            levels = found.level[number % loaded.drive.frames] + 20 * np.log10(max(gain, 1e-9))
            loud = {
                each.name: round(float(db), 1) for each, db in zip(found.profile.places, levels, strict=True) if db > 0
            }
            state = {"playing": loaded.file, "seconds": number / loaded.drive.rate, "drive": intensity / 255}
            state["places_db"] = loud
        return state | {"level": self.level, "late": self.late, "failsafe": self.failsafe}

    def _run(self) -> None:
        units = self.array.placement.units
        silence = np.zeros((units, self.array.array.count // units), np.uint8)
        try:
            with self.array.drives_to_come() as (quiet, self._begin):
                self._quiet = partial(self._put, quiet, silence, 0)
                self._ready.set()
                while (trigger := self._next()) is not None:
                    self._play(*trigger)
        except BaseException as error:  # noqa: BLE001  # raised where the player was entered
            self._error.append(error)
        self._begin = self._now = None
        self._ready.set()
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
                self._quiet(self.array.units.now() + round(1e9 * self.array.hold))

    def _put(self, put: Put, *frame: Any) -> None:
        try:
            put(*frame)
        except SilentFramesError:
            # The program was held up for 50 ms, and the units are silent until the next frame.
            self.failsafe += 1
            self.array.resume()

    def _play(self, loaded: _Loaded, repeats: int, token: LeaseToken) -> None:
        """Play to the end, or until the next trigger or the end of the lease."""
        units, rate, frames = self.array.units, loaded.drive.rate, loaded.drive.frames
        period, ahead, step = divider(rate) * TICK, round(1e9 * min(self.array.hold, 5 / rate)), 1 / (rate * FADE)
        soon, early, block = min(ahead, 500_000), 1_000_000, max(1, round(FollowRules().block * rate))
        if loaded.follower is not None:
            loaded.follower.fall_silent()
            early *= 4
        self.silent.clear()
        loaded.report["plays"] += 1
        first = -(-(units.now() + ahead + early) // period) * period
        number, begin, end, gain, part = 0, 0, 0, self.level, (loaded.phases, loaded.intensities)
        while not repeats or number < repeats * frames:
            if self._permit.refusal(token) is not None:
                return self.array.silence()
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
                part = loaded.frames(at, np.asarray(1e-9 * (clock + np.arange(begin, end) * period), np.float64))
            wait_until(units, first + number * period - ahead)
            gain += min(max(self.level - gain, -step), step)
            intensity = int(part[1][number - begin] * gain)
            self._put(loaded.put, part[0][number - begin], intensity, first + number * period)
            self._now = loaded, number, gain, intensity
            number += 1
            loaded.report["duration"] += 1 / rate
        wait_until(units, first + number * period - ahead)
        return self._quiet(first + number * period)
