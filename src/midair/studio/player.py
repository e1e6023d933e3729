"""The player: the only process that opens the array; it plays nothing without a valid lease.

It checks the lease before every frame or bank switch, and from a thread 200 times per second in between. It has its own
port for STOP. When the studio process ends, it silences the array and ends too. It sends the tracked palm to the pages.
"""

import re
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from midair.array_types import Array
from midair.devices import (
    Cooling,
    ExposureChoices,
    ExposureClearance,
    PosePredictor,
    StopPort,
    Tracker,
)
from midair.errors import DeviceError, DeviceStateError, ExposureError, LinkLostError
from midair.evaluate import ways_to_play
from midair.files import load_solution, load_target, profile_named, save
from midair.model import RATE, Acoustics, Medium, TransducerArray
from midair.physics import PoseBox, middle_of, pose_of
from midair.pressure_level import predicted
from midair.rig import (
    Cleared,
    FollowRules,
    FramePlayer,
    OpenRig,
    PlayObserver,
    PlaySettings,
    Session,
    SolvedAhead,
    VirtualRig,
    array_named,
    correct_air_of_file,
    frame_rig,
    grid_of,
    open_rig,
    open_tracker,
    prepare_check,
    tracker_name,
)
from midair.studio.live_run import LiveRun
from midair.studio.take_data import cleared_facts, exposed
from midair.studio.work import led_pressure, settings_of
from midair.studio.worker_process import NO_ANSWER, StudioPipe, end_with_studio
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
    lease: Any,
    waits: Any,
    listening: socket.socket,
    origins: tuple[str, ...],
    token: str,
    device: str,
    seed: int,
) -> None:
    """Main function of the player process; `waits` is set for a pause to end, `token` is that of the stop port."""
    player = _Player(pipe, lease, device, seed, waits)
    StopPort(listening, token, origins, player.stop).start()
    end_with_studio(lease.stop, player.silence, patience=2.0)
    pipe.send("ready")
    with player.held, player.solver:
        pipe.serve(player.act)


Checked = tuple[Session, Cleared | SolvedAhead, Path]
"""Result of a check: the session that plays, a drive that is cleared or is being solved, and its path."""


@dataclass(slots=True, eq=False)
class _Player(PlayObserver):
    pipe: StudioPipe
    lease: Any
    device: str
    seed: int
    waits: Any = None
    rig: OpenRig | None = None
    """The open rig of a real array."""
    array: Any = None
    """The array that may sound."""
    held: ExitStack = field(default_factory=ExitStack)
    solver: ExitStack = field(default_factory=ExitStack)
    checked: dict[int, Checked] = field(default_factory=dict[int, Checked])
    """Result of each check, by its number."""
    trials: dict[Any, dict[str, Any]] = field(default_factory=dict[Any, dict[str, Any]])
    noise: NoiseOutput = field(default_factory=NoiseOutput)
    palm: PalmWatch | None = None
    loops: FramePlayer | None = None
    """Plays a pattern in a loop."""
    number: int = 0
    live: LiveRun = field(init=False)

    def __post_init__(self) -> None:
        self.live = LiveRun(self.pipe, self.lease)

    def act(self, order: dict[str, Any]) -> Any:
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
                            self.lease.check(order["token"], "silence")
                            time.sleep(0.02)
                    return True
                case "check live":
                    return self.live.check(order["request"])
                case "live":
                    return self._live(order)
                case "keep":
                    return self.live.keep(order)
                case _:  # "end": live touch is over already
                    return NO_ANSWER
        except LinkLostError:
            # Units that stopped answering are opened again for the next drive.
            with suppress(Exception):
                self._close()
            raise

    def note(self, text: str, *, warns: bool = False) -> None:  # noqa: ARG002
        """Send the line; the page of a palm gets those on following."""
        if "follow: " not in text:
            self.pipe.send("solves", text=text)
        elif self.palm is not None:
            self.palm.said.append(text)

    def silence(self) -> None:
        """Silence an open array, from any thread."""
        if self.array is not None:
            self.array.silence()

    def stop(self) -> None:
        """STOP, from any thread; returns when the array is silent."""
        self.lease.stop()
        self.silence()
        self.pipe.send("stopped")

    def _open(self) -> dict[str, Any]:
        """Open the array if necessary and describe it; the virtual one is created again for each check."""
        if self.device == "virtual":
            array = VirtualRig(seed=self.seed).array
            return {"units": "", "count": array.count, "simulated": True}
        array = self._real_rig().array
        said = array.describe()
        return {
            "units": "; ".join(f"{name}: {value}" for name, value in said.items()),
            "count": array.array.count,
            "simulated": array.simulated,
        }

    def _real_rig(self) -> OpenRig:
        if self.rig is None:
            settings = PlaySettings(device=self.device)
            self.rig = self.held.enter_context(OpenRig(array=array_named(self.device), sensor=None, settings=settings))
            self.array = self.rig.array
        return self.rig

    def _close(self) -> None:
        self.rig = self.array = None
        self.held.close()

    @contextmanager
    def _opened(self, rig: OpenRig) -> Generator[None]:
        """Inside, a rig is open and the only one; the array of the studio is open again afterwards."""
        if self.rig is not None and rig.array is self.rig.array:
            yield
            return
        self._close()
        self.array = rig.array
        try:
            with rig:
                yield
        finally:
            self.array = None
            self._open()

    def _admit(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Check the exposure of a drive file on this array, and keep the clearance."""
        path, room = Path(order["path"]), cast("Medium | None", order.get("room"))
        self.solver.close()
        settings = PlaySettings(device=self.device, exposure=_choices(order), repeats=order["repeats"], seed=self.seed)
        if order.get("solve"):
            return self._admit_unsolved(order, path, settings)
        trial = order["path"], order.get("share", 1.0), room
        if order.get("keep") and trial in self.trials:
            return self.trials[trial]
        drive = load_solution(path).drive
        if order.get("correct") and room is not None:
            drive = correct_air_of_file(drive, path, room)
        if (share := order.get("share", 1.0)) != 1.0:
            # Radiation pressure is proportional to the square of the sound pressure, hence of the level.
            drive = replace(drive, level=drive.level * share**0.5)
        self._unfollow()
        follow, tracker = order.get("follow"), None
        if follow:
            settings = settings.but(follow=follow, tracker_latency=order.get("latency"))
            tracker = open_tracker(tracker_name(follow, order.get("latency")))
            centre = middle_of(grid_of(drive))
            self.palm = PalmWatch(tracker, centre, lambda palm: self.pipe.send("palm", palm=palm))
        # The virtual array re-records what is felt while the poses of a file are followed, faster than in real time.
        if self.device == "virtual" and (not follow or follow.startswith("replay:")):
            air = None if room is None else Acoustics(medium=room)
            rig = open_rig(drive=drive, settings=settings.but(acoustics=air))
        else:
            rig = frame_rig(settings, drive.rate) if follow else replace(self._real_rig(), settings=settings)
        session = Session(rig=rig, observer=self, tracker=tracker)
        try:
            cleared = session.clear(drive, endless=bool(order.get("loop")))
        except ExposureError as wrong:
            # The page shows the excess and the possible remedies.
            solved = round(drive.acoustics.medium.degrees, 2)
            said = wrong.exposure.verdict()
            if not order.get("protection"):
                said = said.replace("dB too loud:", "dB too loud for unprotected ears:")
            ways = ways_of(path, wrong.exposure.excess)
            return {"number": 0, "refused": said, "ways": ways, "solved_c": solved, **exposed(wrong.exposure)}
        kept = {found["number"] for found in self.trials.values()} if order.get("keep") else set[int]()
        self.checked = {number: one for number, one in self.checked.items() if number in kept}
        found = self._found(cleared.clearance, drive.acoustics)
        found["duration_s"] = order["repeats"] * drive.frames / drive.rate
        self.checked[self.number] = (session, cleared, path)
        self.trials = dict(list(self.trials.items())[1 - TRIALS :]) | {trial: found} if order.get("keep") else {}
        return found

    def _admit_unsolved(self, order: Mapping[str, Any], path: Path, how: PlaySettings) -> dict[str, Any]:
        """Begin to solve a take for this array; every part is checked ahead of its sound."""
        array = TransducerArray.autd3() if self.device == "virtual" else self._real_rig().array.array
        # Beside the reading of the take.
        ready = prepare_check(array, how.exposure, settings_of(order["solve"]).target.rate)
        transducers, settings, pressure = led_pressure(order["solve"])
        if self.device == "virtual":
            like = {"height": settings.target.grid.height, "cells": pressure.sensor, "band": settings.calibration.band}
            air = settings.acoustics if how.exposure.room is None else Acoustics(medium=how.exposure.room)
            rig = open_rig(settings=how.but(**like, acoustics=air))
        else:
            rig = replace(self._real_rig(), settings=how)
        solving = SolvedAhead(pressure, transducers, rig.array, settings, how, path, ready)
        try:
            clearance = self.solver.enter_context(solving).first_part()
        except ExposureError as wrong:
            raise ExposureError(f"{wrong.exposure.verdict()}; solve it to see what you can do") from None
        # The drive does not exist yet.
        session = Session(rig=rig, observer=self)
        self.checked = {self.number + 1: (session, solving, Path(order["solve"].take))}
        found = self._found(clearance, settings.acoustics)
        # A person answers for all parts, which are checked by now.
        begins = {"verdict": f"first part: {found['verdict']}; each part is checked before it sounds"}
        return found | (begins if how.exposure.override is None else {})

    def _found(self, clearance: ExposureClearance, solved: Acoustics) -> dict[str, Any]:
        """Return a clearance for the page, with the next number."""
        self.number += 1
        return {"number": self.number, "solved_c": round(solved.medium.degrees, 2), **cleared_facts(clearance)}

    def _unfollow(self) -> bool:
        """Close the tracker, if there is one."""
        palm, self.palm = self.palm, None
        if palm is not None:
            palm.close()
        return True

    def _play(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Play what was checked with a lease token; a virtual rig re-records it."""
        kept = order.get("keep") or any(trial["number"] == order["clearance"] for trial in self.trials.values())
        found = self.checked.get(order["clearance"]) if kept else self.checked.pop(order["clearance"], None)
        if found is None:
            raise DeviceStateError("play: expected a drive that was just checked, got none; check its exposure again")
        session, what, path = found
        if session.rig.by_frames and (self.palm is None or self.palm.tracker is not session.tracker):
            raise DeviceStateError("play: expected the tracker of the check, it is closed; check the exposure again")
        with self.noise.over(order["masked"]):
            if isinstance(what, SolvedAhead):
                with self.solver:
                    return self._sound(order, session, what, path)
            if order.get("loop"):
                return self._loop(order["token"], path, what)
            return self._sound(order, session, what, path)

    def _sound(
        self, order: Mapping[str, Any], session: Session, what: Cleared | SolvedAhead, path: Path
    ) -> dict[str, Any]:
        token, output, rig = order["token"], order["output"], session.rig
        if self.palm is not None:
            self.palm.begin()
        # A pause within the stimulus of a study would change it, so there hot units end the play.
        own: Any = {"cooling": None, "participant": order.get("participant", "")}
        if order.get("waits"):
            own["cooling"] = Cooling(report=lambda text: self.pipe.send("heat", text=text), agreed=self.waits.is_set)
        how: Any = {"source": path, "lease": (self.lease, token)}
        rate = what.rate if isinstance(what, SolvedAhead) else what.drive.rate
        with self._opened(rig):
            how["progress"] = self._progress(token, paced=0.0 if rig.sensor is None else rate)
            if isinstance(what, SolvedAhead):
                played = session.play_ahead(what, settings=rig.settings.but(**own), **how)
            else:
                played = session.play(replace(what, settings=what.settings.but(**own)), **how)
        if played.report is not None:
            return {"output": "", **asdict(played.report)}
        if output and played.take is not None:
            save(played.take.recording, Path(output), calibration=played.take.calibration, force=True)
        return {"output": Path(output).name if output else "", "frames": played.drive.frames}

    def _loop(self, token: Any, path: Path, what: Cleared) -> dict[str, Any]:
        """Play a pattern again and again, until a StoppedError.

        Meanwhile, "change" draws a file in its place and checks its exposure; the next pass is the new one.
        """
        # A person answered for the pattern that was checked, not for a louder one.
        up_to = what.clearance.exposure.excess + 0.01
        rig = frame_rig(what.settings.but(repeats=1, exposure=replace(what.settings.exposure, up_to=up_to)), RATE)
        array, pattern = rig.frames, path.with_name(path.name.replace(".drive.h5", ".toml"))
        try:
            with self._opened(rig), array.drives_to_come() as (quiet, begin), ThreadPoolExecutor(1) as pool:
                self.loops = player = FramePlayer(Session(rig=rig), quiet, begin)
                player.lease = self.lease
                file = player.load(pattern, None, False, {})["file"]
                playing = pool.submit(player.run)
                player.triggers.put((player.loaded_file(file), 0, token, False))
                try:
                    while not playing.done():
                        self.lease.check(token, self.device)
                        self.pipe.send("sounds", done=0, total=0, emitting=array.emitting)
                        if self.pipe.poll(0.05) and (asked := self.pipe.receive()) is not None:
                            self.pipe.handle(asked, self._while_playing)
                finally:
                    player.triggers.put(None)
                return playing.result() or {}
        finally:
            self.loops = None

    def _while_playing(self, order: dict[str, Any]) -> Any:
        if order["do"] not in ("change", "unfollow", "keep"):
            raise DeviceStateError("play: expected an idle array, something plays; press STOP")
        return self.act(order)

    def _live(self, order: dict[str, Any]) -> dict[str, Any]:
        """Play live touch, whose process opens the array, which is open here again afterwards."""
        self._close()
        try:
            return self.live.play(order, self._while_playing)
        finally:
            self._open()

    def _progress(self, token: Any, paced: float = 0.0) -> Any:
        """Return a callback that reports progress; a virtual array is slowed down to real time."""
        began = sent = 0.0

        def progress(done: int, total: int) -> None:
            nonlocal began, sent
            began = began or time.monotonic()
            # The lease is checked as often as for the banks of a real array.
            while paced and time.monotonic() < began + done / paced:
                self.lease.check(token, "virtual")
                time.sleep(0.002)
            if time.monotonic() - sent > 0.05 or done >= total:
                sent = time.monotonic()
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


def ways_of(path: Path, excess: float) -> list[tuple[str, int | None]]:
    """Ways to play a drive that is `excess` dB too loud, and how many of ten people feel each; None needs a solve."""
    solution, target = load_solution(path, streamed=True), load_target(path, streamed=True)
    if target is None:
        return []
    _, whole = predicted(path, solution, target)
    source = "" if target.provenance.last("draw") else path.name
    return [
        (", ".join([way.name, *re.findall(r"\d+dB", way.option)]), way.felt and way.felt.people[0])
        for way in ways_to_play(whole, excess, source=source)
    ]
