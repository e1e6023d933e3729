"""The player: the only process that opens the array; it plays nothing without a valid lease.

It checks the lease before every frame or bank switch, and from a thread 200 times per second in between. It has its own
port for STOP. When the studio process ends, it silences the array and ends too.
"""

import socket
import threading
import time
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from midair.devices import Cooling, ExposureChoices, check_exposure, measure_exposure
from midair.errors import DeviceError, DeviceStateError, ExposureError, LinkLostError
from midair.files import load_solution, profile_named, save
from midair.model import Acoustics, Medium
from midair.rig import (
    VirtualRig,
    array_named,
    correct_air_of_file,
    open_rig,
    play_cleared,
    rerecord,
    solving,
    under_lease,
)
from midair.studio.stop_port import StopPort
from midair.studio.work import led_pressure, settings_of
from midair.studio.worker_process import StudioPipe, end_with_studio
from midair.study import Headphones

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
    with player.held:
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
    admitted: dict[int, tuple[Any, Path, Medium | None]] = field(
        default_factory=dict[int, tuple[Any, Path, Medium | None]]
    )
    trials: dict[Any, dict[str, Any]] = field(default_factory=dict[Any, dict[str, Any]])
    noise: NoiseOutput = field(default_factory=NoiseOutput)
    number: int = 0
    solves: ExitStack = field(default_factory=ExitStack)
    changed: tuple[Any, Path, Medium | None] | None = None
    checks: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def act(self, order: Mapping[str, Any]) -> Any:
        """Handle one request."""
        try:
            match order["do"]:
                case "open":
                    return self._open()
                case "admit":
                    self.solves.close()
                    return self._admit(order)
                case "stream":
                    self.solves.close()
                    self.checks = order
                    return self._stream(order)
                case "play":
                    return self._play(order)
                case "mask":
                    self.trials.clear()
                    return self.noise.take(order["noise"], order["device"])
                case "quiet":
                    return self._quiet(order)
                case _:
                    # "let go": another process uses the array for a while.
                    self.solves.close()
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
        trial = order["path"], order.get("share", 1.0), room
        if order.get("keep") and trial in self.trials:
            return self.trials[trial]
        drive = load_solution(path).drive
        if order.get("correct"):
            drive = correct_air_of_file(drive, path, room)
        if (share := order.get("share", 1.0)) != 1.0:
            # Radiation pressure is proportional to the square of the sound pressure, hence of the level.
            drive = replace(drive, level=drive.level * share**0.5)
        if self.device != "virtual" and self.array is None:
            self._open()
        array: Any = self.array if self.device != "virtual" else self._virtual(drive, room).array
        choices = _choices(order)
        profile = choices.profile
        solved = {"solved_c": round(drive.acoustics.medium.degrees, 2)}
        try:
            admission = check_exposure(drive, array, choices, repeats=order["repeats"])
        except ExposureError as wrong:
            # The page shows the excess and the possible remedies, so the exposure is measured again.
            found = measure_exposure(drive, array.array, profile, room=room)
            return {"number": 0, "refused": str(wrong), **solved, **exposed(found)}
        found = self._admitted(admission, path, room, keep=bool(order.get("keep"))) | solved
        self.trials = dict(list(self.trials.items())[1 - TRIALS :]) | {trial: found} if order.get("keep") else {}
        return found

    def _admitted(self, admission: Any, path: Path, room: Medium | None, *, keep: bool = False) -> dict[str, Any]:
        """Keep a clearance for the next order to play, and describe it."""
        self.number += 1
        kept = {found["number"] for found in self.trials.values()} if keep else set[int]()
        self.admitted = {number: one for number, one in self.admitted.items() if number in kept}
        self.admitted[self.number] = (admission, path, room)
        drive, stream = admission.drive, admission.stream
        return {
            "number": self.number,
            "outcome": admission.decided,
            "verdict": admission.verdict(),
            "by": admission.by,
            "duration_s": admission.repeats * drive.frames / drive.rate,
            "wait_s": 0.0 if stream is None else stream.delay(),
            "refused": "",
            **exposed(admission.exposure if stream is None else stream.exposure),
        }

    def _stream(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Solve a take for this array until `solves` is closed, and keep the clearance of its frames to come."""
        request, room = order["solve"], order.get("room")
        settings = settings_of(request)
        if self.device != "virtual" and self.array is None:
            self._open()
        array: Any = VirtualRig(seed=self.seed).array_device() if self.device == "virtual" else self.array
        pressure = led_pressure(request, settings, streamed=True)
        stream = self.solves.enter_context(solving(pressure, array.array, settings, array, _choices(order)))
        solved = {"solved_c": round(settings.acoustics.medium.degrees, 2)}
        try:
            admission = stream.clearance()
        except ExposureError as wrong:
            if stream.exposure is None:
                raise
            return {"number": 0, "refused": str(wrong), **solved, **exposed(stream.exposure)}
        return self._admitted(admission, Path(request.take), room) | solved

    def _change(self, order: Mapping[str, Any]) -> None:
        """Solve with other settings while a loop plays; the pass that begins after its frames suffice plays them."""
        with self.pipe.answering(dict(order)):
            found = self._stream({**self.checks, **order})
            if found["refused"]:
                raise ExposureError(found["refused"])
            admitted = self.admitted.pop(found["number"])
            while admitted[0].stream is not None and admitted[0].stream.delay():
                time.sleep(0.02)
            self.changed = admitted
            self.pipe.answer(dict(order), found)

    def _virtual(self, drive: Any, room: Medium | None) -> Any:
        """Create a virtual rig with the array, cells, height and band of a drive, in its air or that of the room."""
        return open_rig(drive=drive, acoustics=None if room is None else Acoustics(medium=room), seed=self.seed)

    def _play(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Play a checked drive with a lease token; a virtual rig re-records it."""
        kept = any(trial["number"] == order["admission"] for trial in self.trials.values())
        found = self.admitted.get(order["admission"]) if kept else self.admitted.pop(order["admission"], None)
        if found is None:
            raise DeviceStateError("play: expected a drive that was just checked, got none; check its exposure again")
        passes, self.changed, report = int(order.get("passes", 1)), None, dict[str, Any]()
        try:
            with self.noise.over(order["masked"]):
                for number in range(passes):
                    found, self.changed = self.changed or found, None
                    if number and found[0].stream is not None:
                        found[0].stream.check_loop(passes - number)
                    report = self._let_sound(order, *found)
        finally:
            self.solves.close()
        return report

    def _quiet(self, order: Mapping[str, Any]) -> bool:
        """Present silence for as long as the other stimuli, with the same noise."""
        with self.noise.over(order["masked"]):
            end = time.monotonic() + order["seconds"]
            while time.monotonic() < end:
                self.permit.check(order["leave"], "silence")
                time.sleep(0.02)
        return True

    def _let_sound(self, order: Mapping[str, Any], admission: Any, path: Path, room: Medium | None) -> dict[str, Any]:
        leave, output = order["leave"], order["output"]
        if self.device != "virtual":
            self.array.participant = order.get("participant", "")
            # A pause within the stimulus of a study would change it, so there hot units end the play.
            self.array.cooling = self._cooling() if order.get("waits") else None
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

    def _cooling(self) -> Cooling:
        return Cooling(report=lambda text: self.pipe.send("heat", text=text), agreed=self.waits.is_set)

    def _progress(self, leave: Any, paced: float = 0.0) -> Any:
        """Return a callback that reports progress; a virtual array is slowed down to real time."""
        began, sent = time.monotonic(), [0.0]

        def progress(done: int, total: int) -> None:
            while self.pipe.poll() and (order := self.pipe.receive()) is not None:
                threading.Thread(target=self._change, args=(order,), daemon=True).start()
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
        profile=profile_named(order["profile"]),
        attenuate=order["attenuate"],
        override=order["override"] or None,
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
