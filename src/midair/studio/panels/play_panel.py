"""Playing from any panel: exposure check, arming by a held button, renewal of the lease, STOP."""

import asyncio
import secrets
import socket
import time
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from midair.devices import PlayLease
from midair.errors import (
    DeviceStateError,
    ExposureError,
    InputError,
    LinkLostError,
    MidairError,
    SilentFramesError,
    StoppedError,
)
from midair.files import DEFAULT_PROFILE
from midair.model import HEIGHTS, Medium
from midair.physics import MOST_PROTECTION
from midair.processes import shared_event
from midair.rig import PlaySettings
from midair.settings import EARS, Mode
from midair.studio.player import run_player
from midair.studio.room_air import RoomAir, degrees_of
from midair.studio.studio_state import Arguments, Page, StudioState, declared
from midair.studio.take_data import stamp_of
from midair.studio.takes_list import DRAWN, TakesList, take_of
from midair.studio.work import SolveRequest
from midair.studio.worker_process import WorkerProcess

ATTEMPTS = 3
"""Number of attempts to open an array that does not answer."""

ALIVE = 0.5
"""Seconds for which the lease lasts after the last "alive" message of the page in control."""

SOUNDLESS = 10.0
"""The same for the virtual array, which makes no sound: a page may be hidden, or draw slowly."""


class SolveForm(Arguments):
    """Settings of a drive; None means the default of the mode."""

    take: str = Field(max_length=1000)
    mode: Mode = "best"
    mapping: Literal["half-wave", "constant-offset", "slow-bias", "receptors"] | None = None
    method: Literal["live", "fast", "lm", "glide"] | None = None
    level: Annotated[float, Field(gt=0, le=1)] | Literal["auto"] | None = None
    gain: float | None = Field(default=None, gt=0, le=100)
    ears_db: float | None = Field(default=None, ge=EARS[0], le=EARS[1])
    height_mm: float | None = Field(default=None, ge=1e3 * HEIGHTS[0], le=1e3 * HEIGHTS[1])
    guard_mm: float | None = Field(default=None, ge=0, le=100)
    visible_s: float | None = Field(default=None, ge=0)
    replaces: str = Field(default="", max_length=100)
    beside: bool = False
    """Keep the drive of this mode and make a further one."""

    def choices(self) -> tuple[tuple[str, Any], ...]:
        """Return the settings that differ from the mode, in their own units."""
        given = self.model_dump(include={"mapping", "method", "level", "gain"}) | {"ears": self.ears_db}
        for name, length in (("height", self.height_mm), ("guard", self.guard_mm)):
            given[name] = None if length is None else length * 1e-3
        return tuple((name, value) for name, value in given.items() if value is not None)


class CheckExposure(Arguments):
    """Drive and settings to check before playing."""

    take: str = Field(max_length=1000)
    profile: str = Field(default="", max_length=100)
    attenuate: bool = False
    override: str = Field(default="", max_length=200)
    protection_db: float = Field(default=0.0, ge=0, le=MOST_PROTECTION)
    repeats: int = declared(PlaySettings, "repeats", most=1000)
    correct_air: bool = False
    solve: SolveForm | None = None
    """Settings for a take that was not solved: it is solved while it plays."""
    follow: str = Field(default="", max_length=300)
    latency_ms: float | None = Field(default=None, ge=0, le=1000)


class PlayNow(Arguments):
    """Play a checked drive, after the button was held."""

    clearance: int
    loop: bool = False
    """Play until STOP, without a re-recording; a drive that is solved meanwhile is played from the next pass.

    A pattern of Draw goes round without a gap, while `change` replaces it.
    """


class PlayPanel:
    """The player process and the lease that it needs to play."""

    def __init__(
        self,
        store: StudioState,
        takes: TakesList,
        air: RoomAir,
        later: Any,
        *,
        device: str,
        seed: int,
        origins: tuple[str, ...],
    ) -> None:
        self._store, self._takes, self._air, self._later = store, takes, air, later
        self.token = secrets.token_urlsafe(24)
        self.lease = PlayLease()
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._waits = shared_event()
        self._arguments = self.lease, self._waits, self._listening, origins, self.token, device, seed
        self._player = WorkerProcess(
            run_player,
            self._on_message,
            name="player",
            absent="player: expected a running process, it is starting or has ended; try again",
            gone="player: the process ended; the failsafe of the array has silenced it",
            call=later,
            on_end=self._restart,
            daemon=False,
        )
        self._closed = False
        self._controls = 0
        self._opening: asyncio.Future[None] | None = None
        self._checked: dict[int, tuple[CheckExposure, Medium | None]] = {}
        self.newest = ""
        """Name of the drive that was solved last."""
        self._stops = self.lease.stops
        self.played: list[Any] = []
        self.live: Callable[[dict[str, Any]], None] = lambda _: None
        """Gets the events of live touch."""
        self.request: Callable[[SolveForm, str], SolveRequest] | None = None
        self._state: dict[str, Any] = {
            "state": "starts",
            "device": device,
            "simulated": device == "virtual",
            "count": 0,
            "units": "",
            "done": 0,
            "total": 0,
            "emitting": False,
            "take": "",
            "said": "",
            "hot": "",
            "waits": False,
            "loop": False,
        }
        store.offer("play", "check", self.check, CheckExposure)
        store.offer("play", "play", self.play, PlayNow)
        store.offer("play", "unfollow", self.unfollow)
        store.offer("play", "stop", self.stop, watchers=True)
        store.offer("play", "wait", self.wait)
        store.offer("control", "take", self.take_control, watchers=True)
        store.offer("control", "give", self.give_control)
        store.offer("control", "refuse", self.refuse_control)
        store.left.append(self._left)
        store.alive.append(self._alive)
        self._show()

    @property
    def port(self) -> int:
        """The player's port for STOP; it stays the same when the player is restarted."""
        return self._listening.getsockname()[1]

    @property
    def sounding(self) -> bool:
        """True if something plays or may start to at any moment."""
        return self.lease.armed or self._state["emitting"]

    @property
    def device(self) -> str:
        """Name of the array."""
        return self._state["device"]

    def start(self) -> None:
        """Start the player."""
        self._player.start(*self._arguments)

    def close(self) -> None:
        """Silence the array and end the player."""
        self._closed = True
        self.lease.stop()
        self._player.close(3)
        self._listening.close()

    def _restart(self) -> None:
        # The failsafe of the array has silenced it. The lease is revoked, and a new process starts.
        self._later(self._on_message, {"kind": "gone"})
        self.lease.stop()
        if not self._closed:
            self.start()

    async def check(self, _: Page, order: CheckExposure) -> Any:
        """Check the exposure of a drive and return it."""
        self._busy()
        return await self._admit(order)

    async def _admit(self, order: CheckExposure, up_to: float = inf, *, loop: bool = False) -> Any:
        drive = self._takes.beside(order.take, ".drive.h5")
        solve = None
        if not drive.exists():
            if order.solve is None or self.request is None or order.correct_air or order.follow or order.attenuate:
                raise InputError(f"{order.take}: expected a take that was solved; solve it first")
            solve = self.request(order.solve, order.take)
        if order.correct_air and self._air.medium is None:
            raise InputError("phases: expected the air of the room to correct them for, got none; state it first")
        if self._state["state"] == "failed":
            await self._open()
        # The air of the check; another one may be stated while it is made.
        room = self._air.medium
        found = await self._player.ask(
            "admit",
            path=str(drive),
            solve=solve,
            profile=order.profile or DEFAULT_PROFILE,
            attenuate=order.attenuate,
            override=order.override.strip(),
            up_to=up_to,
            protection=order.protection_db,
            repeats=order.repeats,
            loop=loop,
            room=room,
            correct=order.correct_air,
            follow=self._tracker(order.follow),
            latency=None if order.latency_ms is None else 1e-3 * order.latency_ms,
        )
        again = self._takes.beside(order.take, ".rerecorded.h5")
        found["replaces"] = again.name if self.device == "virtual" and again.exists() else ""
        self._checked = {found["number"]: (order, room)} if found["number"] else {}
        self._store.put(exposure={"take": order.take, **found})
        return found

    def _tracker(self, name: str) -> str:
        """Name of a tracker; the file of a replay lies in the studio's folder."""
        kind, _, rest = name.partition(":")
        place, mark, options = rest.partition("?")
        return f"replay:{self._takes.folder.find(place)}{mark}{options}" if kind == "replay" else name

    async def unfollow(self, _: Page, __: Arguments) -> Any:
        """Close the tracker that the last check opened."""
        return await self._player.ask("unfollow")

    async def play(self, page: Page, order: PlayNow) -> Any:
        """Arm and play; answers when it is over, which a loop is after a STOP or an error."""
        self._busy()
        self._seen(page)
        if order.clearance not in self._checked:
            raise DeviceStateError("play: expected a drive that was just checked; check its exposure again")
        self.newest, stops, number, stamp = "", self.lease.stops, order.clearance, None
        # A person answered for the drive that was checked, not for a louder one.
        up_to = self._store.state["exposure"]["excess_db"] + 0.01 if order.loop else inf
        while True:
            check, room = self._checked[number]
            self.check_same_air(room)
            if order.loop and check.take.startswith(DRAWN) and not check.follow:
                how = {"clearance": number, "output": "", "masked": False, "loop": True}
                return await self._sound(page, check.take, "play", **how)
            if not order.loop:
                del self._checked[number]
                return await self._once(page, check.take, number)
            newer = self.newest if take_of(self.newest) == take_of(check.take) else check.take
            drive = self._takes.beside(newer, ".drive.h5")
            # A drive is checked as a loop before its first pass; one that is not solved yet, after that pass.
            if drive.exists() and (newer, stamp_of(drive)) != stamp:
                stamp = newer, stamp_of(drive)
                # Nothing else may play while the drive is checked.
                self._show(state="plays", said="checks the exposure of the loop")
                try:
                    found = await self._admit(check.model_copy(update={"take": newer}), up_to, loop=True)
                finally:
                    self._show(state="ready")
                if not found["number"]:
                    raise ExposureError(found["refused"])
                number = found["number"]
                check, room = self._checked[number]
            if self.lease.stops != stops:
                raise StoppedError("play: stopped on request")
            self._seen(page)
            how = {"output": "", "masked": False, "waits": True, "keep": True}
            await self._sound(page, check.take, "play", clearance=number, **how)

    async def _once(self, page: Page, take: str, number: int) -> dict[str, Any]:
        """Play a checked drive, and replace the re-recording beside it if the array is virtual."""
        output = self._takes.beside(take, ".rerecorded.h5")
        partial = output.with_name(f".{output.name.removesuffix('.h5')}.partial.h5")
        how = {"clearance": number, "output": str(partial), "masked": False, "waits": True}
        report = await self._sound(page, take, "play", **how)
        if report.get("output") and partial.exists():
            partial.replace(output)
            report["output"] = output.name
        for callback in self.played:
            callback(take)
        return report

    async def change(self, pattern: Path) -> dict[str, Any]:
        """Let the pattern of a file replace the one that plays in a loop; ExposureError if it may not."""
        return await self._player.ask("change", path=str(pattern))

    async def admit_trial(
        self, path: Path, share: float, *, override: str = "", room: Medium | None = None
    ) -> dict[str, Any]:
        """Check a drive of a study and keep it for its trials; ExposureError above the profile without an override."""
        how = {"profile": DEFAULT_PROFILE, "attenuate": False, "override": override, "repeats": 1, "share": share}
        found = await self._player.ask("admit", path=str(path), keep=True, room=room, **how)
        if not found["number"]:
            raise ExposureError(f"{path.name}: {found['refused']}")
        return found

    async def mask(self, noise: Any, device: str) -> str:
        """Open a sound output for the noise of a study, or close it if there is none; returns a description."""
        return await self._player.ask("mask", noise=noise, device=device)

    async def present(
        self, path: Path, share: float, *, masked: bool = False, participant: str = "", room: Medium | None = None
    ) -> dict[str, Any]:
        """Play a drive of a study while the controlling page is visible; SilentFramesError if frames were late."""
        self._experimenter()
        found = await self.admit_trial(path, share, room=room)
        page = self._experimenter()
        order = {"clearance": found["number"], "output": "", "masked": masked, "participant": participant}
        report = await self._sound(page, path.name, "play", **order)
        if report.get("gap"):
            raise SilentFramesError(
                f"array: expected every frame in time, {report['late']} were late after {report['gap']:.3f} s of "
                "silence; close other programs and present it again"
            )
        return report

    async def quiet(self, seconds: float, *, masked: bool = False) -> None:
        """Present silence of the given length with the same noise."""
        await self._sound(self._experimenter(), "silence", "quiet", seconds=seconds, masked=masked)

    def begin_presentation(self) -> None:
        """Call at the start of a presentation: a STOP from now on ends it, also between its sounds."""
        self._stops = self.lease.stops

    def check_same_air(self, room: Medium | None) -> None:
        """Raise DeviceStateError if the air of the room is not that of an exposure check."""
        if degrees_of(self._air.medium) != degrees_of(room):
            raise DeviceStateError("play: the air of the room changed since the check; check the exposure again")

    def _experimenter(self) -> Page:
        if self.lease.stops != self._stops:
            raise StoppedError("play: stopped on request")
        self._busy()
        page = self._store.pages.get(self._store.control.holder)
        if page is None or not self._watches(page):
            raise DeviceStateError(
                "play: expected the experimenter's page to be visible, it is hidden or closed; show it"
            )
        return page

    async def _sound(self, page: Page, what: str, do: str, **order: Any) -> Any:
        """Arm for a page, run a request of the player, and disarm in any case."""
        self._controls = page.number
        self._waits.clear()
        token = self.lease.arm(lasts=self._patience)
        self._show(state="plays", take=what, done=0, total=0, said="", loop=order.get("loop", False))
        try:
            report = await self._player.ask(do, token=token, **order)
        except MidairError as wrong:
            self._show(state="ready", emitting=False, said=str(wrong), hot="", waits=False)
            raise
        finally:
            self.lease.disarm()
        self._show(state="ready", emitting=False, said="played to its end", hot="", waits=False)
        return report

    async def check_live(self, request: dict[str, Any]) -> Any:
        """Return the worst-case exposure of live touch, with the number by which `play_live` starts it."""
        self._busy()
        found = await self._player.ask("check live", request=request)
        self._store.put(exposure={"take": "", **found})
        return found

    async def play_live(self, page: Page, what: str, number: int, *, stops: int) -> str:
        """Arm and play checked live touch, with events for `live`; returns how it ended when it is over.

        `stops` is the number of stop requests when the page asked: a later one refuses the array.
        """
        self._busy()
        self._seen(page)
        if self.lease.stops != stops:
            raise StoppedError("live: stopped on request")
        report = await self._sound(page, what, "live", clearance=number)
        said = report["error"] or "ended normally, with a fade-out"
        self._show(said=said)
        return said

    async def keep_live(self, **order: Any) -> Any:
        """Save the last seconds of live touch as a take."""
        return await self._player.ask("keep", **order)

    def end_live(self) -> None:
        """Fade out and end live touch."""
        self._player.send("end")

    def wait(self, _: Page, __: Arguments) -> bool:
        """Let playback continue once the units have cooled."""
        self._waits.set()
        self._show(waits=True)
        return True

    @property
    def _patience(self) -> float:
        return SOUNDLESS if self._state["device"] == "virtual" else ALIVE

    def _watches(self, page: Page) -> bool:
        """Whether a page is shown to a person, as far as the array needs it."""
        here = time.monotonic() - page.last_alive <= self._patience
        return here and (page.visible or self._state["device"] == "virtual")

    def _seen(self, page: Page) -> None:
        if not self._watches(page):
            raise DeviceStateError("play: expected the page to be visible, it is hidden or does not respond; show it")

    def stop(self, _: Page, __: Arguments) -> bool:
        """STOP, from any page: revokes the lease; the player's thread silences the array within milliseconds."""
        self.lease.stop()
        return True

    def take_control(self, page: Page, _: Arguments) -> bool:
        """Request control for a page."""
        had = self._store.control.take(page.number)
        self._store.show_control()
        return had

    def give_control(self, page: Page, _: Arguments) -> bool:
        """Hand over control; anything that the former holder armed ends."""
        control = self._store.control
        control.give(page.number, to=control.asking)
        self.lease.stop()
        self._store.show_control()
        return True

    def refuse_control(self, page: Page, _: Arguments) -> bool:
        """Keep control."""
        self._store.control.refuse(page.number)
        self._store.show_control()
        return True

    def _busy(self) -> None:
        if self._state["state"] == "plays":
            raise DeviceStateError("play: expected an idle array, something plays; press STOP or wait for its end")

    def _alive(self, page: Page) -> None:
        """Renew the lease for the page in control while it is visible."""
        if page.number != self._controls or page.number != self._store.control.holder:
            return
        if self._watches(page):
            self.lease.renew(lasts=self._patience)
        elif self.lease.armed:
            self.lease.stop()

    def _left(self, page: Page) -> None:
        if page.number == self._controls:
            self.lease.stop()

    def _on_message(self, said: dict[str, Any]) -> None:
        match said["kind"]:
            case "ready":
                self._show(state="opens")
                self._opening = asyncio.ensure_future(self._open())
            case "sounds":
                self._show(done=said["done"], total=said["total"], emitting=said["emitting"])
            case "solves":
                self._show(said=said["text"])
            case "palm":
                self._store.put(palm=said["palm"])
            case "heat":  # units are too hot; the second message ends that
                self._waits.clear()
                hot = "" if self._state["hot"] else said["text"]
                self._show(hot=hot, waits=said.get("waits", False), emitting=False)
            case "goes":
                self._show(emitting=said["emitting"])
                self.live(said)
            case "began" | "frames" | "follow":
                self.live(said)
            case "stopped":
                self._show(emitting=False, said="silenced")
            case _:
                self._store.put(palm=None)
                self._show(state="starts", emitting=False, said="the player ended unexpectedly and is starting again")

    async def _open(self) -> None:
        for left in reversed(range(ATTEMPTS)):
            try:
                found = await self._player.ask("open")
                break
            except LinkLostError as wrong:
                # Units, in particular emulated ones, may answer late while the studio is starting.
                if not left:
                    self._show(state="failed", said=str(wrong))
                    return
                await asyncio.sleep(1.0)
            except MidairError as wrong:
                self._show(state="failed", said=str(wrong))
                return
        else:
            return
        self._show(state="ready", units=found["units"], count=found["count"], simulated=found["simulated"], said="")

    def _show(self, **changes: Any) -> None:
        self._state = {**self._state, **changes}
        self._store.put(player=self._state)
