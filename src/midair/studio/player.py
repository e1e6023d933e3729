"""The player: the only process that opens the array; it plays nothing without a valid lease.

It checks the lease before every frame or bank switch, and from a thread 200 times per second in between. It has its own
port for STOP. When the studio process ends, it silences the array and ends too.
"""

import os
import signal
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import connection, get_context, parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from midair.studio.noise_process import NoiseProcess
from midair.studio.stop_port import StopPort

TRIALS = 32
"""Checked drives of a session that are kept, so that later trials start as quickly as the first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayerPlan:
    """Settings of the player process."""

    device: str = "virtual"
    """Name of the array, as in ``midair play --device``."""
    seed: int = 0
    token: str = ""
    """Secret for the stop port."""
    origins: tuple[str, ...] = ()
    """Origins of the pages that may use the stop port."""


def run_player(pipe: Connection, permit: Any, listening: socket.socket, plan: PlayerPlan) -> None:
    """Main function of the player process, which ends with its studio."""
    # Ctrl-C in the terminal ends the studio, and this process with it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    player = _Player(pipe, permit, plan)
    port = StopPort(listening, plan.token, plan.origins, player.stop)
    port.start()
    threading.Thread(target=player.end_with_the_studio, name="studio", daemon=True).start()
    player.serve()


@dataclass(slots=True, eq=False)
class _Player:
    pipe: Connection
    permit: Any
    plan: PlayerPlan
    array: Any = None
    admitted: dict[int, tuple[Any, Path]] = field(default_factory=dict[int, tuple[Any, Path]])
    trials: dict[tuple[str, float], dict[str, Any]] = field(default_factory=dict[tuple[str, float], dict[str, Any]])
    noise: NoiseProcess = field(default_factory=NoiseProcess)
    number: int = 0
    emits: bool = False

    def serve(self) -> None:
        """Handle one request after the other."""
        from midair.errors import LinkLostError, MidairError

        self._send("ready", process=os.getpid())
        with ExitStack() as held:
            while True:
                try:
                    order: dict[str, Any] = self.pipe.recv()
                except (EOFError, OSError):
                    return
                try:
                    match order["do"]:
                        case "open":
                            self._send("answer", id=order["id"], value=self._open(held))
                        case "admit":
                            self._send("answer", id=order["id"], value=self._admit(order, held))
                        case "play":
                            self._send("answer", id=order["id"], value=self._play(order))
                        case "mask":
                            self.trials.clear()
                            self._send("answer", id=order["id"], value=self.noise.take(order["noise"], order["device"]))
                        case "quiet":
                            self._send("answer", id=order["id"], value=self._quiet(order))
                        case "let go":
                            # Another process uses the array for a while.
                            held.close()
                            self.array = None
                            self._send("answer", id=order["id"], value=True)
                        case _:
                            return
                except MidairError as wrong:
                    if isinstance(wrong, LinkLostError):
                        # Units that stopped answering are opened again for the next drive.
                        self.array = None
                        with suppress(Exception):
                            held.close()
                    self._send("wrong", id=order["id"], error=str(wrong), of=type(wrong).__name__)
                except Exception as wrong:  # noqa: BLE001  # a failed request must not end the player
                    said = f"this is an error in midair, please report it: {type(wrong).__name__}: {wrong}"
                    self._send("wrong", id=order["id"], error=said, of="unforeseen")

    def stop(self) -> None:
        """STOP, from any thread; returns when the array is silent."""
        self.permit.stop()
        if self.array is not None:
            self.array.silence()
        self._send("stopped", by="the page, at the player's own port")

    def end_with_the_studio(self) -> None:
        """Wait for the end of the studio, then silence the array and end the process."""
        studio = parent_process()
        if studio is None:
            return
        connection.wait([studio.sentinel])
        with suppress(Exception):
            self.permit.stop()
        with suppress(Exception):
            if self.array is not None:
                self.array.silence()
        # The main thread reads the stopped lease and closes the device; wait for that, but not forever.
        time.sleep(2.0)
        os._exit(0)

    def _open(self, held: ExitStack) -> dict[str, Any]:
        """Open the array if necessary and describe it; the virtual one is created again for each drive."""
        from midair.rig import VirtualRig, array_named

        if self.plan.device == "virtual":
            array = VirtualRig(seed=self.plan.seed).array
            return {"name": "virtual", "units": "", "count": array.count, "simulated": True, "heard": True}
        if self.array is None:
            self.array = held.enter_context(array_named(self.plan.device))
        said = self.array.describe()
        return {
            "name": self.array.name,
            "units": "; ".join(f"{name}: {value}" for name, value in said.items()),
            "count": self.array.array.count,
            "simulated": self.array.simulated,
            "heard": False,
        }

    def _admit(self, order: Mapping[str, Any], held: ExitStack) -> dict[str, Any]:
        """Check the exposure of a drive file on this array, and keep the clearance."""
        from midair.devices import ExposureChoices, check_exposure
        from midair.errors import ExposureError
        from midair.files import load_solution, profile_named

        path, trial = Path(order["path"]), (order["path"], order.get("share", 1.0))
        if order.get("keep") and trial in self.trials:
            return self.trials[trial]
        drive = load_solution(path).drive
        if (share := order.get("share", 1.0)) != 1.0:
            # Radiation pressure is proportional to the square of the sound pressure, hence of the level.
            drive = replace(drive, level=drive.level * share**0.5)
        if self.plan.device != "virtual" and self.array is None:
            self._open(held)
        array: Any = self.array if self.plan.device != "virtual" else self._virtual(drive).array_device()
        profile = profile_named(order["profile"])
        choices = ExposureChoices(profile=profile, attenuate=order["attenuate"], override=order["override"] or None)
        try:
            admission = check_exposure(drive, array, choices, repeats=order["repeats"])
        except ExposureError as wrong:
            # The page shows the excess and the possible remedies, so the exposure is measured again.
            return {"number": 0, "refused": str(wrong), **exposed(_measured(drive, array, profile))}
        self.number += 1
        kept = {found["number"] for found in self.trials.values()} if order.get("keep") else set[int]()
        self.admitted = {number: one for number, one in self.admitted.items() if number in kept}
        self.admitted[self.number] = (admission, path)
        found = {
            "number": self.number,
            "outcome": admission.outcome,
            "verdict": admission.verdict(),
            "by": admission.by,
            "duration_s": admission.repeats * drive.frames / drive.rate,
            "refused": "",
            **exposed(admission.exposure),
        }
        self.trials = dict(list(self.trials.items())[1 - TRIALS :]) | {trial: found} if order.get("keep") else {}
        return found

    def _virtual(self, drive: Any) -> Any:
        """Create a virtual rig with the array, cells, height and band of a drive."""
        from midair.rig import VirtualRig
        from midair.settings import Settings
        from midair.targets import sensor_from_provenance

        known = Settings.of(drive.provenance) or Settings()
        rig = VirtualRig(
            array=drive.array.nominal,
            cells=sensor_from_provenance(drive.provenance),
            height=known.target.grid.height,
            seed=self.plan.seed,
        )
        return rig.hearing(known.calibration.band)

    def _play(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """Play a checked drive with a lease token; a virtual rig re-records it."""
        from midair.errors import DeviceStateError

        kept = any(trial["number"] == order["admission"] for trial in self.trials.values())
        found = self.admitted.get(order["admission"]) if kept else self.admitted.pop(order["admission"], None)
        if found is None:
            raise DeviceStateError("play: expected a drive that was just checked, got none; check its exposure again")
        with self.noise.over(order["masked"]):
            return self._let_sound(order, *found)

    def _quiet(self, order: Mapping[str, Any]) -> bool:
        """Present silence for as long as the other stimuli, with the same noise."""
        with self.noise.over(order["masked"]):
            end = time.monotonic() + order["seconds"]
            while time.monotonic() < end:
                self.permit.check(order["leave"], "silence")
                time.sleep(0.02)
        return True

    def _let_sound(self, order: Mapping[str, Any], admission: Any, path: Path) -> dict[str, Any]:
        from midair.files import save
        from midair.rig import play_cleared, rerecord, under_lease

        leave, output = order["leave"], order["output"]
        if self.plan.device != "virtual":
            with under_lease(self.array, self.permit, leave):
                report = play_cleared(admission, self.array, source=path, progress=self._progress(leave))
            return {"output": "", **asdict(report)}
        rig = self._virtual(admission.drive)
        skin = rig.skin()
        with rig.array_device(skin) as array, rig.sensor(skin) as sensor:
            self.array = array
            try:
                with under_lease(array, self.permit, leave):
                    paced = self._progress(leave, paced=admission.drive.rate)
                    heard = rerecord(admission, array, sensor, source=path, progress=paced)
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
                self._send("sounds", done=done, total=total, emitting=bool(getattr(self.array, "emitting", True)))

        return progress

    def _send(self, kind: str, **said: Any) -> None:
        with suppress(OSError, ValueError), _SENDING:
            self.pipe.send({"kind": kind, **said})


_SENDING = threading.Lock()


def _measured(drive: Any, array: Any, profile: Any) -> Any:
    from midair.devices import measure_exposure

    return measure_exposure(drive, array.array, profile)


def exposed(found: Any) -> dict[str, Any]:
    """Return an exposure for the page: level and limit of each place in dB."""
    place, _ = found.worst
    return {
        "worst": place.name,
        "excess_db": round(float(found.excess), 2),
        "pressure_pa": round(float(found.pressure), 2),
        "profile": found.profile.name,
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


class PlayerProcess:
    """The player process, as the studio uses it.

    `on_message` is called from a thread with each message of the player.
    """

    def __init__(self, permit: Any, plan: PlayerPlan, on_message: Any) -> None:
        self._permit, self._plan, self._on_message = permit, plan, on_message
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._process: Any = None
        self._pipe: Connection | None = None
        self._closed = False

    @property
    def port(self) -> int:
        """Port for STOP; it stays the same when the player is restarted."""
        return self._listening.getsockname()[1]

    @property
    def process(self) -> int:
        """Process ID; 0 if there is no process."""
        return self._process.pid if self._process is not None and self._process.is_alive() else 0

    def start(self, origins: tuple[str, ...]) -> None:
        """Start the process."""
        context = get_context("spawn")
        self._pipe, there = context.Pipe()
        plan = replace(self._plan, origins=origins)
        self._process = context.Process(
            target=run_player, args=(there, self._permit, self._listening, plan), name="midair player"
        )
        self._process.start()
        there.close()
        threading.Thread(target=self._listen, args=(self._pipe, origins), name="player", daemon=True).start()

    def send(self, order: dict[str, Any]) -> None:
        """Send a request; DeviceStateError if the process does not run."""
        from midair.errors import DeviceStateError

        try:
            if self._pipe is None:
                raise OSError
            self._pipe.send(order)
        except OSError as wrong:
            raise DeviceStateError(
                "player: expected a running process, it is starting or has ended; try again"
            ) from wrong

    def close(self) -> None:
        """Silence the array and end the process."""
        self._closed = True
        self._permit.stop()
        with suppress(Exception):
            self.send({"do": "end", "id": 0})
        if self._process is not None:
            self._process.join(3)
            if self._process.is_alive():
                self._process.terminate()
                self._process.join(2)
        self._listening.close()

    def _listen(self, pipe: Connection, origins: tuple[str, ...]) -> None:
        while True:
            try:
                self._on_message(pipe.recv())
            except (EOFError, OSError):
                break
        if not self._closed:
            self._on_message({"kind": "gone"})
            # The failsafe of the array has silenced it. The lease is revoked, and a new process starts.
            self._permit.stop()
            self.start(origins)
