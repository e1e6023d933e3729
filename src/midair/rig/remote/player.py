"""Plays the drives that clients load, in a thread, frame by frame."""

import os
import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.devices import (
    TICK,
    ExposureClearance,
    LeaseToken,
    PlayLease,
    Put,
    RawPose,
    SteeredClearance,
    Tracker,
    divider,
    intensity_bytes,
    phase_bytes,
)
from midair.errors import InputError, SilentFramesError
from midair.files import load_solution
from midair.model import Acoustics, Drive, Medium, Provenance, TransducerArray
from midair.patterns import PATTERN_ENDINGS, draw, drawn_settings, load_pattern
from midair.rig.names.sensor_names import tracker_options
from midair.rig.playing.following import Follower, FollowRules, grid_of, wait_until
from midair.rig.session import Session
from midair.solvers import one_blas_thread

LEASE, FADE, WORD = 0.5, 0.005, 0.008
"""Times in s: without a sign of life until the client in control loses the array; of a change of the level from 0 to 1;
between silent frames."""


def leave_realtime() -> None:
    """Give a thread the usual priority, so that its work does not hold up the thread that plays."""
    if hasattr(os, "sched_setscheduler"):
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class PalmReports:
    """The palm as clients report it, as the source of a tracker."""

    host_clock = True

    def __init__(self) -> None:
        self._poses = queue.SimpleQueue[RawPose | str]()
        self.open = self.close = lambda: None
        self.add = self._poses.put

    def pull(self, wait: float) -> list[RawPose | str]:
        """The next pose, if one arrives within a time in s."""
        with suppress(queue.Empty):
            return [self._poses.get(timeout=wait or 1e-6)]
        return []


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loaded:
    """A file that may play, and its order in the log."""

    about: dict[str, Any]
    """Description for clients: the name of its file, values of its parameters and more."""
    again: Callable[[dict[str, float]], dict[str, Any]] | None = None
    """Loads it again with values of its parameters."""
    rate: float
    length: int
    """Number of frames of a pass."""
    places_db: Array
    """Level at each place of the exposure profile, shape (frame, place), in dB."""
    frames: Callable[[slice, Array], tuple[Any, Any]]
    """Phases and intensities of frames that sound at times in s of this computer's clock."""
    put: Put
    log: Callable[[str, str], None]
    report: dict[str, Any]
    """Number and duration of its plays."""
    follower: Follower | None = None
    block: int
    """Number of frames that are asked for at once."""


Trigger = tuple[Loaded, int, LeaseToken, bool]
"""The drive that plays, its passes, the permission, and whether its level rises from 0."""


class FramePlayer:
    """Plays loaded drives inside `drives_to_come` of an array, in a thread that runs `run` until a trigger is None."""

    def __init__(self, session: Session, quiet: Put, begin: Any) -> None:
        self.session, self.array, self.settings = session, session.rig.frames, session.rig.settings
        self._begin, array = begin, self.array
        silence = np.zeros((array.placement.units, array.array.count // array.placement.units), np.uint8)
        self._quiet = partial(self._put, quiet, silence, 0)
        self.lease, self._token = PlayLease(), LeaseToken(number=0, stops=0)
        self.loaded: dict[str, Loaded] = {}
        self.level, self._late, self._failsafe = 1.0, 0, 0
        self.palm, self.silent = PalmReports(), threading.Event()
        self.tracker = Tracker(self.palm, name="palm", options=tracker_options("osc:")[0])
        self.triggers = queue.SimpleQueue[Trigger | None]()
        self._now: tuple[Loaded, int, float, int] | None = None

    def load(self, path: Path, duration: float | None, follow: bool, values: dict[str, float]) -> dict[str, Any]:
        """Read or draw a file, check its exposure and log the order; slow, for a thread of its own.

        While the file plays, its next pass is the new one.
        """
        leave_realtime()
        array, units = self.array, self.array.placement.units
        drawn = path.suffix in PATTERN_ENDINGS
        if values and not drawn:
            raise InputError(f"parameter: expected a pattern, got the drive {path.name}")
        drive = self._drawn(path, duration, values) if drawn else load_solution(path).drive
        if not 100 <= drive.rate <= 8000 or drive.level.ndim > 1:
            expected = "100 to 8000 frames a second with one level for all transducers"
            raise InputError(f"{path.name}: expected {expected}, got {drive.rate:g} Hz, {drive.level.shape} levels")
        follower, how = None, self.settings.but(follow="osc:" if follow else None, steer_only=True)
        clearance = self.session.clear(drive, how, endless=True).clearance
        if isinstance(clearance, SteeredClearance):
            follower = Follower(
                self.tracker, drive, grid_of(drive), rules=FollowRules(fit=False), report=lambda _: None
            )
        else:
            drive = clearance.check_for(array)
        phases, intensities = np.asarray(phase_bytes(drive, units)), np.asarray(intensity_bytes(drive, 1))

        def frames(part: slice, times: Array) -> tuple[Any, Any]:
            if follower is None or not isinstance(clearance, SteeredClearance):
                return phases[part], intensities[part]
            steered = clearance.steered(*follower.steered(part, times))
            return phase_bytes(steered, units), intensity_bytes(steered, 1)

        about: dict[str, Any] = {"file": path.name, "seconds": drive.frames / drive.rate, "rate_hz": drive.rate}
        about |= {"follow": follow, "parameters": values, "exposure": clearance.verdict()}
        made: dict[str, Any] = {"about": about, "again": partial(self.load, path, duration, follow), "frames": frames}
        made |= {"rate": drive.rate, "length": drive.frames, "follower": follower}
        self.add(clearance, path, **made, block=max(1, round(FollowRules().block * drive.rate)))
        return about

    def add(self, clearance: ExposureClearance, source: str | Path, **made: Any) -> None:
        """Begin the order of what was cleared, with the fields of `Loaded`, so that it can be played."""
        report = {"plays": 0, "duration": 0.0}
        put, log = self._begin(clearance, source, report)
        made |= {"places_db": clearance.exposure.level, "put": put, "log": log, "report": report}
        self.loaded[made["about"]["file"]] = Loaded(**made)

    def _drawn(self, path: Path, duration: float | None, values: dict[str, float]) -> Drive:
        foci, (array, acoustics) = load_pattern(path, values).foci(duration), self.aim()
        life = drawn_settings(foci, acoustics).noted(Provenance(source=path.name))
        return replace(draw(foci, array, acoustics=acoustics).drive, provenance=life)

    def aim(self) -> tuple[TransducerArray, Acoustics]:
        """The array, with its stored calibration, and the air for which drives are drawn."""
        return self.session.rig.transducers, Acoustics(medium=self.settings.exposure.room or Medium.at())

    def loaded_file(self, file: str) -> Loaded:
        """A loaded file; InputError if it is not loaded."""
        if file not in self.loaded:
            raise InputError(f"file: expected one that is loaded, {sorted(self.loaded)}, got {file[:60]!r}; load it")
        return self.loaded[file]

    def trigger(self, file: str, repeats: int) -> Loaded:
        """Play a loaded file now."""
        loaded = self.loaded_file(file)
        if self.lease.refusal(self._token) is not None:
            self._token = self.lease.arm(lasts=LEASE)
        self.silent.clear()
        self.triggers.put((loaded, repeats, self._token, False))
        return loaded

    def state(self) -> dict[str, Any]:
        """Return what plays now, its level, and the levels at the places of the exposure profile in dB."""
        state = {"level": self.level, "late": self._late, "failsafe": self._failsafe}
        if (now := self._now) is None:
            return state | {"playing": None, "seconds": 0.0, "drive": 0.0, "places_db": {}}
        loaded, number, gain, intensity = now
        levels = loaded.places_db[number % len(loaded.places_db)] + 20 * np.log10(max(gain, 1e-9))
        places = zip(self.settings.exposure.profile.places, levels, strict=True)
        loud = {place.name: round(float(each), 1) for place, each in places if each > 0}
        state |= {"playing": loaded.about["file"], "seconds": number / loaded.rate}
        return state | {"drive": intensity / 255, "places_db": loud}

    @one_blas_thread()
    def run(self) -> None:
        """Send silent frames, and play each trigger."""
        trigger: Trigger | None = None
        while True:
            if trigger is None and self.triggers.empty():
                self._now = None
                self.silent.set()
            try:
                trigger = trigger or self.triggers.get(timeout=WORD)
            except queue.Empty:
                self._quiet(self.array.units.now() + round(1e9 * self.array.hold))
                continue
            if trigger is None:
                return
            trigger = self._play(*trigger)

    def _put(self, put: Callable[..., None], *frame: Any) -> None:
        try:
            put(*frame)
        except SilentFramesError:  # the program was held up for 50 ms; the next frame sounds again
            self._failsafe += 1
            self.array.resume()

    def _play(self, loaded: Loaded, repeats: int, token: LeaseToken, rises: bool) -> Trigger | None:
        """Play to the end, or until the next trigger or the end of the lease.

        If the file was loaded again, return a trigger of the remaining passes, after the level has fallen to 0.
        """
        units, rate, frames = self.array.units, loaded.rate, loaded.length
        period, ahead, step = divider(rate) * TICK, round(1e9 * min(self.array.hold, 5 / rate)), 1 / (rate * FADE)
        soon, early = min(ahead, 500_000), 1_000_000
        if loaded.follower is not None:
            loaded.follower.fall_silent()
            early *= 4
        self.silent.clear()
        loaded.report["plays"] += 1
        # The exposure check saw this drive after silence, and not after what is interrupted.
        rises = rises or self._now is not None
        first = -(-(units.now() + ahead + early) // period) * period
        number, begin, end, phases, intensities = 0, 0, 0, np.zeros(0), np.zeros(0)
        before, gain = loaded.report["duration"], -step if rises else self.level
        while not repeats or number < repeats * frames:
            if self.lease.refusal(token) is not None:
                return self.array.silence()
            if not self.triggers.empty():
                return None
            if (missed := -(-(units.now() + soon - first - number * period) // period)) > 0:
                # The units keep the frame before.
                self._late, number = self._late + missed, number + missed
                continue
            newest, at = self.loaded[loaded.about["file"]], number % frames
            if newest is not loaded and at == 0 and gain <= 0:
                return newest, repeats and repeats - number // frames, token, True
            if number >= end:
                begin, end = number, number + min(loaded.block, frames - at)
                clock = first + time.monotonic_ns() - units.now()
                times = 1e-9 * (clock + np.arange(begin, end, dtype=np.float64) * period)
                phases, intensities = loaded.frames(slice(at, at + end - begin), times)
            wait_until(units, first + number * period - ahead)
            level = 0.0 if newest is not loaded and frames - at <= FADE * rate + 1 else self.level
            gain += min(max(level - gain, -step), step)
            intensity = int(intensities[number - begin] * gain)
            self._put(loaded.put, phases[number - begin], intensity, first + number * period)
            self._now = loaded, number, gain, intensity
            number += 1
            loaded.report["duration"] = before + number / rate
        wait_until(units, first + number * period - ahead)
        return self._quiet(first + number * period)
