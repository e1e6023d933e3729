"""The player: the only process that opens the array; it plays nothing without a valid lease.

It checks the lease before every frame or bank switch, and from a thread 200 times per second in between. It has its own
port for STOP. When the studio process ends, it silences the array and ends too. It sends the tracked palm to the pages.
"""

import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from midair.array_types import Array
from midair.devices import (
    Cooling,
    ExposureChoices,
    PosePredictor,
    Tracker,
    check_exposure,
    measure_exposure,
)
from midair.errors import DeviceError, DeviceStateError, ExposureError, LinkLostError
from midair.files import load_solution, profile_named, save
from midair.model import RATE, Acoustics, Medium
from midair.physics import PoseBox, middle_of, pose_of
from midair.rig import (
    FollowRules,
    FramePlayer,
    PlaySettings,
    SolvedAhead,
    VirtualRig,
    array_named,
    clear_followed,
    correct_air_of_file,
    follow_simulated,
    grid_of,
    immediate_array,
    open_rig,
    open_tracker,
    play_cleared,
    play_followed,
    rerecord,
    tracker_name,
    under_lease,
)
from midair.studio.stop_port import StopPort
from midair.studio.work import led_pressure
from midair.studio.worker_process import StudioPipe, end_with_studio
from midair.study import Headphones


class PalmWatch:
    """Sends the palm of an open tracker 15 times a second by `send`, which gets None at the end; closes the tracker."""

    def __init__(self, tracker: Tracker, solved: Array, send: Callable[[dict[str, Any] | None], object]) -> None:
        self.tracker = tracker
        self.said = deque[str](maxlen=64)
        """Lines of a play that follows the palm."""
        self._solved, self._send, self._box = solved, send, PoseBox()
        self._predictor, self._newest = PosePredictor(), -np.inf
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="palm", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End, and close the tracker."""
        self._ends.set()
        self._thread.join(5.0)
        self.tracker.close()
        self._send(None)

    def begin(self) -> None:
        """Set time 0 of replayed poses to now."""
        self._predictor, self._newest = PosePredictor(), -np.inf
        self.tracker.begin(time.monotonic())

    def _run(self) -> None:
        while not self._ends.wait(1 / 15):
            self._send(self.palm())

    def palm(self) -> dict[str, Any]:
        """The palm now, in mm and degrees, from the place for which the drive was solved."""
        status, new = self.tracker.status(), self.tracker.poses(self._newest)
        found: dict[str, Any] = {
            "tracker": self.tracker.name,
            "state": status.state,
            "rate": round(status.rate),
            "confidence": round(status.confidence, 2),
            "latency_ms": round(1e3 * status.latency, 1),
            "refused": dict(status.refused),
            "said": next((line[8:] for line in reversed(self.said) if line.startswith("follow: ")), ""),
            "solved": _mm(self._solved),
            "box": [1e3 * edge for edge in self._box.size],
            "place": None,
        }
        if new is not None:
            self._predictor.add(new)
            self._newest, self._seen = float(new.time[-1]), pose_of(new, -1)
        if not np.isfinite(self._newest):
            return found
        ahead = self._predictor.at(np.array([time.monotonic()]))
        x, _, z = self._seen.normal[0]
        return found | {
            "place": _mm(self._seen.centre[0]),
            "predicted": _mm(ahead.centre[0]),
            "tilt": round(float(np.degrees(np.arccos(np.clip(-z, -1, 1)))), 1),
            "lean": round(float(np.degrees(np.arctan2(x, -z))), 1),
            "inside": bool(self._box.inside(self._seen, self._solved)[0]),
            "sure": status.state == "tracking" and status.confidence >= FollowRules().confidence,
        }


def _mm(place: Array) -> list[float]:
    return [round(1e3 * float(each), 1) for each in place]


TRIALS = 32
"""Checked drives of a session that are kept, so that later trials start as quickly as the first."""


class NoiseOutput:
    """White noise in the participant's headphones during a presentation, which masks the sound of the array."""

    def __init__(self) -> None:
        self._held: Any = None

    def take(self, noise: Any, device: str) -> str:
        """Open the named output for the noise of a plan, or close it if there is none; returns a description."""
        held, self._held = self._held, None
        if held is not None:
            held.__exit__(None, None, None)
        if noise is None:
            return ""
        self._held = Headphones(noise, device=device).__enter__()
        return noise.said

    @contextmanager
    def over(self, wanted: bool) -> Generator[None]:
        """Play noise within the block if `wanted`; DeviceError if the output is not open."""
        if not wanted:
            yield
            return
        if self._held is None:
            raise DeviceError("headphones: expected an open sound output, got none; leave the session and resume it")
        self._held.on()
        try:
            yield
        finally:
            self._held.off()


def run_player(
    pipe: StudioPipe,
    permit: Any,
    waits: Any,
    listening: socket.socket,
    origins: tuple[str, ...],
    token: str,
    device: str,
    seed: int,
) -> None:
    """Main function of the player process; `waits` is set for a pause to end, `token` is that of the stop port."""
    player = _Player(pipe, permit, device, seed, waits)
    StopPort(listening, token, origins, player.stop).start()
    end_with_studio(permit.stop, player.silence, patience=2.0)
    pipe.send("ready")
    with player.held, player.solver:
        pipe.serve(player.act)


@dataclass(slots=True, eq=False)
class _Player:
    pipe: StudioPipe
    permit: Any
    device: str
    seed: int
    waits: Any = None
    array: Any = None
    held: ExitStack = field(default_factory=ExitStack)
    solver: ExitStack = field(default_factory=ExitStack)
    admitted: dict[int, Any] = field(default_factory=dict[int, Any])
    """Clearance, path and exposure limits of each check by its number."""
    trials: dict[Any, dict[str, Any]] = field(default_factory=dict[Any, dict[str, Any]])
    noise: NoiseOutput = field(default_factory=NoiseOutput)
    palm: PalmWatch | None = None
    followed: tuple[Any, PlaySettings] | None = None
    loops: FramePlayer | None = None
    """Plays a pattern in a loop."""
    number: int = 0

    def act(self, order: Mapping[str, Any]) -> Any:
        """Handle one request."""
        try:
            match order["do"]:
                case "open":
                    return self._open()
                case "admit":
                    return self._admit(order)
                case "play":
                    return self._play(order)
                case "change":
                    if self.loops is None:
                        raise DeviceStateError("play: expected a pattern that plays in a loop, got none; play it again")
                    return self.loops.load(Path(order["path"]), None, False, {})
                case "mask":
                    self.trials.clear()
                    return self.noise.take(order["noise"], order["device"])
                case "unfollow":
                    self.solver.close()
                    return self._unfollow()
                case "quiet":
                    with self.noise.over(order["masked"]):
                        end = time.monotonic() + order["seconds"]
                        while time.monotonic() < end:
                            self.permit.check(order["leave"], "silence")
                            time.sleep(0.02)
                    return True
                case _:
                    # "let go": another process uses the array for a while.
                    self.held.close()
                    self.array = None
                    return True
        except LinkLostError:
            # Units that stopped answering are opened again for the next drive.
            self.array = None
            with suppress(Exception):
                self.held.close()
            raise

    def silence(self) -> None:
        """Silence an open array, from any thread."""
        if self.array is not None:
            self.array.silence()

    def stop(self) -> None:
        """STOP, from any thread; returns when the array is silent."""
        self.permit.stop()
        self.silence()
        self.pipe.send("stopped")

    def _open(self) -> dict[str, Any]:
        """Open the array if necessary and describe it; the virtual one is created again for each drive."""
        if self.device == "virtual":
            array = VirtualRig(seed=self.seed).array
            return {"units": "", "count": array.count, "simulated": True}
        if self.array is None:
            self.array = self.held.enter_context(array_named(self.device))
        said = self.array.describe()
        return {
            "units": "; ".join(f"{name}: {value}" for name, value in said.items()),
            "count": self.array.array.count,
            "simulated": self.array.simulated,
        }

    def _admit(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Check the exposure of a drive file on this array, and keep the clearance."""
        path = Path(order["path"])
        room: Any = order.get("room")
        self.solver.close()
        if order.get("solve"):
            return self._admit_unsolved(order, path)
        trial = order["path"], order.get("share", 1.0), room
        if order.get("keep") and trial in self.trials:
            return self.trials[trial]
        drive = load_solution(path).drive
        if order.get("correct"):
            drive = correct_air_of_file(drive, path, room)
        if (share := order.get("share", 1.0)) != 1.0:
            # Radiation pressure is proportional to the square of the sound pressure, hence of the level.
            drive = replace(drive, level=drive.level * share**0.5)
        self._unfollow()
        if self.device != "virtual" and self.array is None:
            self._open()
        array: Any = self.array if self.device != "virtual" else self._virtual(drive, room).array
        # The virtual array re-records what is felt while the poses of a file are followed, faster than in real time.
        simulated, repeats, endless = True, order["repeats"], bool(order.get("loop"))
        if follow := order.get("follow"):
            tracker, grid = tracker_name(follow, order.get("latency")), grid_of(drive)
            opened, simulated = open_tracker(tracker), self.device == "virtual" and follow.startswith("replay:")
            self.palm = PalmWatch(opened, middle_of(grid), lambda palm: self.pipe.send("palm", palm=palm))
            if simulated:
                drive = follow_simulated(drive, tracker, grid, repeats=repeats, report=lambda _: None)
                repeats = 1
        choices = _choices(order)
        try:
            if simulated:
                admission = check_exposure(drive, array, choices, repeats=repeats, endless=endless)
            else:
                how = PlaySettings(device=self.device, exposure=choices, repeats=repeats)
                admission = clear_followed(drive, array, how, grid_of(drive), endless=endless)
                self.followed = (drive, how)
        except ExposureError as wrong:
            # The page shows the excess and the possible remedies, so the exposure is measured again.
            found = measure_exposure(drive, array.array, choices.profile, room=room)
            solved = round(drive.acoustics.medium.degrees, 2)
            return {"number": 0, "refused": str(wrong), "solved_c": solved, **exposed(found)}
        kept = {found["number"] for found in self.trials.values()} if order.get("keep") else set[int]()
        self.admitted = {number: one for number, one in self.admitted.items() if number in kept}
        found = self._found(admission, repeats * drive.frames / drive.rate, drive.acoustics)
        self.admitted[self.number] = (admission, path, choices)
        self.trials = dict(list(self.trials.items())[1 - TRIALS :]) | {trial: found} if order.get("keep") else {}
        return found

    def _admit_unsolved(self, order: Mapping[str, Any], path: Path) -> dict[str, Any]:
        """Begin to solve a take for this array; every part is checked ahead of its sound."""
        transducers, settings, pressure = led_pressure(order["solve"])
        how = PlaySettings(device=self.device, exposure=_choices(order), repeats=order["repeats"])
        if self.device == "virtual":
            like = {"height": settings.target.grid.height, "cells": pressure.sensor, "band": settings.calibration.band}
            array: Any = open_rig(settings=how.but(**like, acoustics=settings.acoustics, seed=self.seed)).array
        else:
            self._open()
            array = self.array
        solving = SolvedAhead(pressure, transducers, array, settings, how, path)
        admission = self.solver.enter_context(solving).first_part()
        # The drive does not exist yet.
        self.admitted = {self.number + 1: (solving, Path(order["solve"].take), how.exposure)}
        found = self._found(admission, order["repeats"] * pressure.frames / pressure.rate, settings.acoustics)
        return found | {"verdict": f"first part: {found['verdict']}; each part is checked before it sounds"}

    def _found(self, admission: Any, duration: float, solved: Acoustics) -> dict[str, Any]:
        """Return a clearance for the page, with the next number."""
        self.number += 1
        return {
            "number": self.number,
            "outcome": admission.outcome,
            "verdict": admission.verdict(),
            "by": admission.by,
            "duration_s": duration,
            "refused": "",
            "solved_c": round(solved.medium.degrees, 2),
            **exposed(admission.exposure),
        }

    def _unfollow(self) -> bool:
        """Close the tracker, if there is one."""
        palm, self.palm, self.followed = self.palm, None, None
        if palm is not None:
            palm.close()
        return True

    def _follow(self, order: Mapping[str, Any], admission: Any, path: Path) -> dict[str, Any]:
        """Play a drive frame by frame, each steered to the palm of the tracker."""
        if self.palm is None or self.followed is None:
            raise DeviceStateError("play: expected the tracker of the check, it is closed; check the exposure again")
        (drive, how), tracker, leave = self.followed, self.palm.tracker, order["leave"]
        self.held.close()
        self.array = array = immediate_array(how, drive.rate)
        array.participant = order.get("participant", "")
        told: Any = {"source": path, "report": self.palm.said.append, "progress": self._progress(leave)}
        try:
            with array, under_lease(array, self.permit, leave):
                done = play_followed(drive, array, tracker, how, admission, grid_of(drive), **told)
        finally:
            self.array = None
            self._open()
        return {"output": "", **asdict(done.report)}

    def _loop(self, leave: Any, path: Path, choices: ExposureChoices) -> dict[str, Any]:
        """Play a pattern again and again, until a StoppedError.

        Meanwhile, "change" draws a file in its place and checks its exposure; the next pass is the new one.
        """
        self.held.close()
        how = PlaySettings(device=self.device, exposure=choices)
        self.array = array = immediate_array(how, RATE)
        try:
            with array, array.drives_to_come() as (quiet, begin), ThreadPoolExecutor(1) as pool:
                self.loops = player = FramePlayer(array, how, quiet, begin)
                player.permit = self.permit
                file = player.load(path, None, False, {})["file"]
                playing = pool.submit(player.run)
                player.triggers.put((player.loaded_file(file), 0, leave, False))
                try:
                    while not playing.done():
                        self.permit.check(leave, self.device)
                        self.pipe.send("sounds", done=0, total=0, emitting=array.emitting)
                        if self.pipe.poll(0.05) and (asked := self.pipe.receive()) is not None:
                            self.pipe.handle(asked, self._during_a_loop)
                finally:
                    player.triggers.put(None)
                return playing.result() or {}
        finally:
            self.array = self.loops = None
            self._open()

    def _during_a_loop(self, order: Mapping[str, Any]) -> Any:
        if order["do"] not in ("change", "unfollow"):
            raise DeviceStateError("play: expected an idle array, a pattern plays in a loop; press STOP")
        return self.act(order)

    def _virtual(self, drive: Any, room: Medium | None) -> Any:
        """Create a virtual rig with the array, cells, height and band of a drive, in its air or that of the room."""
        return open_rig(drive=drive, acoustics=None if room is None else Acoustics(medium=room), seed=self.seed)

    def _play(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Play a checked drive with a lease token; a virtual rig re-records it."""
        kept = order.get("keep") or any(trial["number"] == order["admission"] for trial in self.trials.values())
        found = self.admitted.get(order["admission"]) if kept else self.admitted.pop(order["admission"], None)
        if found is None:
            raise DeviceStateError("play: expected a drive that was just checked, got none; check its exposure again")
        with self.noise.over(order["masked"]):
            if not isinstance(found[0], SolvedAhead):
                return self._let_sound(order, *found)
            solving: SolvedAhead = found[0]
            wait = partial(self.permit.check, order["leave"], self.device)
            with self.solver:
                ready = solving.in_time(lambda text: self.pipe.send("solves", text=text), wait)
                report = self._let_sound(order, ready, *found[1:])
                solving.finish()
                return report

    def _let_sound(self, order: Mapping[str, Any], admission: Any, path: Path, choices: ExposureChoices) -> Any:
        leave, output, room = order["leave"], order["output"], choices.room
        if order.get("loop"):
            # A person answered for the pattern that was checked, not for a louder one.
            choices = replace(choices, up_to=admission.exposure.excess + 0.01)
            return self._loop(leave, path.with_name(path.name.replace(".drive.h5", ".toml")), choices)
        if self.palm is not None:
            self.palm.begin()
        if admission.box is not None:
            return self._follow(order, admission, path)
        if self.device != "virtual":
            self.array.participant = order.get("participant", "")
            # A pause within the stimulus of a study would change it, so there hot units end the play.
            self.array.cooling = None
            if order.get("waits"):
                self.array.cooling = Cooling(
                    report=lambda text: self.pipe.send("heat", text=text), agreed=self.waits.is_set
                )
            with under_lease(self.array, self.permit, leave):
                report = play_cleared(admission, self.array, source=path, progress=self._progress(leave), room=room)
            return {"output": "", **asdict(report)}
        with self._virtual(admission.drive, room) as rig:
            sensor: Any = rig.sensor
            self.array = rig.array
            try:
                with under_lease(rig.array, self.permit, leave):
                    paced = self._progress(leave, paced=admission.drive.rate)
                    heard = rerecord(admission, rig.array, sensor, source=path, progress=paced)
            finally:
                self.array = None
        if output:
            save(heard, Path(output), calibration=sensor.calibration)
        return {"output": Path(output).name if output else "", "frames": admission.drive.frames}

    def _progress(self, leave: Any, paced: float = 0.0) -> Any:
        """Return a callback that reports progress; a virtual array is slowed down to real time."""
        began, sent = time.monotonic(), [0.0]

        def progress(done: int, total: int) -> None:
            # The lease is checked as often as for the banks of a real array.
            while paced and time.monotonic() < began + done / paced:
                self.permit.check(leave, "virtual")
                time.sleep(0.002)
            if time.monotonic() - sent[0] > 0.05 or done >= total:
                sent[0] = time.monotonic()
                self.pipe.send("sounds", done=done, total=total, emitting=bool(getattr(self.array, "emitting", True)))

        return progress


def _choices(order: Mapping[str, Any]) -> ExposureChoices:
    return ExposureChoices(
        profile=profile_named(order["profile"]).behind(order.get("protection", 0.0)),
        attenuate=order["attenuate"],
        override=order["override"] or None,
        up_to=order.get("up_to", np.inf),
        room=order.get("room"),
    )


def exposed(found: Any) -> dict[str, Any]:
    """Return an exposure for the page: level and limit of each place in dB."""
    place, _ = found.worst
    return {
        "worst": place.name,
        "excess_db": round(float(found.excess), 2),
        "pressure_pa": round(float(found.pressure), 2),
        "profile": found.profile.name,
        "heat": found.heat,
        "measured_in": found.measured_in,
        "places": [
            {
                "name": place.name,
                "peak_db": round(float(found.peak[number]), 1),
                "limit_db": place.limit,
                "enforced": place.enforced,
            }
            for number, place in enumerate(found.profile.places)
        ],
    }
