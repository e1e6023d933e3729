"""Playing from any panel: exposure check, arming by a held button, renewal of the lease, STOP."""

import asyncio
import itertools
import secrets
import time
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from midair import errors
from midair.errors import DeviceStateError, ExposureError, InputError, LinkLostError, MidairError, SilentFramesError
from midair.rig import LeaseToken, PlayLease
from midair.studio.player import PlayerPlan, PlayerProcess
from midair.studio.studio_state import NoArguments, Page, StudioState
from midair.studio.takes_list import TakesList

ATTEMPTS = 3
"""Number of attempts to open an array that does not answer."""

ALIVE = 0.5
"""Seconds for which the lease lasts after the last "alive" message of the page in control."""


class CheckExposure(BaseModel):
    """Drive and settings to check before playing."""

    model_config = ConfigDict(extra="forbid")
    take: str = Field(max_length=1000)
    profile: str = Field(default="", max_length=100)
    attenuate: bool = False
    override: str = Field(default="", max_length=200)
    repeats: int = Field(default=1, ge=1, le=1000)


class PlayNow(BaseModel):
    """Play a checked drive, after the button was held."""

    model_config = ConfigDict(extra="forbid")
    admission: int


class PlayPanel:
    """The player process and the lease that it needs to play; `profile` names the default exposure profile."""

    def __init__(self, store: StudioState, takes: TakesList, plan: PlayerPlan, later: Any, *, profile: str) -> None:
        self._store, self._takes, self._later, self._profile = store, takes, later, profile
        self.permit = PlayLease()
        self.token = plan.token or secrets.token_urlsafe(24)
        self._player = PlayerProcess(self.permit, plan, self._forward)
        self._waiting: dict[int, asyncio.Future[Any]] = {}
        self._numbers = itertools.count(1)
        self._controls = 0
        self._opening: asyncio.Future[None] | None = None
        self._checked: dict[int, str] = {}
        self.played: list[Any] = []
        self._state: dict[str, Any] = {
            "state": "starts",
            "device": plan.device,
            "simulated": plan.device == "virtual",
            "count": 0,
            "units": "",
            "done": 0,
            "total": 0,
            "emitting": False,
            "take": "",
            "said": "",
        }
        store.offer("play", "check", self.check, CheckExposure)
        store.offer("play", "play", self.play, PlayNow)
        store.offer("play", "stop", self.stop, NoArguments, watchers=True)
        store.offer("control", "take", self.take_control, watchers=True)
        store.offer("control", "give", self.give_control)
        store.offer("control", "refuse", self.refuse_control)
        store.left.append(self._left)
        store.alive.append(self._alive)
        self._show()

    @property
    def port(self) -> int:
        """The player's port for STOP."""
        return self._player.port

    @property
    def sounding(self) -> bool:
        """True if something plays or may start to at any moment."""
        return self.permit.armed or self._state["emitting"]

    @property
    def device(self) -> str:
        """Name of the array."""
        return self._state["device"]

    @property
    def process(self) -> int:
        """Process ID of the player."""
        return self._player.process

    def start(self, origins: tuple[str, ...]) -> None:
        """Start the player."""
        self._player.start(origins)

    def close(self) -> None:
        """Silence the array and end the player."""
        self._player.close()

    async def check(self, _: Page, order: CheckExposure) -> Any:
        """Check the exposure of a drive and return it."""
        drive = self._takes.beside(order.take, ".drive.h5")
        if not drive.exists():
            raise InputError(f"{order.take}: expected a take that was solved; solve it first")
        self._busy()
        found = await self._ask(
            do="admit",
            path=str(drive),
            profile=order.profile or self._profile,
            attenuate=order.attenuate,
            override=order.override.strip(),
            repeats=order.repeats,
        )
        self._checked = {found["number"]: order.take} if found["number"] else {}
        self._store.put(exposure={"take": order.take, **found})
        return found

    async def play(self, page: Page, order: PlayNow) -> Any:
        """Arm and play; answers when it is over."""
        self._busy()
        self._seen(page)
        take = self._checked.pop(order.admission, None)
        if take is None:
            raise DeviceStateError("play: expected a drive that was just checked; check its exposure again")
        output = self._takes.beside(take, ".rerecorded.h5")
        partial = self._beside(output)
        report = await self._sound(page, take, do="play", admission=order.admission, output=str(partial), masked=False)
        if report.get("output") and partial.exists():
            partial.replace(output)
            report["output"] = output.name
        for callback in self.played:
            callback(take)
        return report

    async def admit_trial(self, path: Path, share: float, *, override: str = "") -> dict[str, Any]:
        """Check a drive of a study and keep it for its trials; ExposureError above the profile without an override."""
        how = {"profile": self._profile, "attenuate": False, "override": override, "repeats": 1, "share": share}
        found = await self._ask(do="admit", path=str(path), keep=True, **how)
        if not found["number"]:
            raise ExposureError(f"{path.name}: {found['refused']}")
        return found

    async def mask(self, noise: Any, device: str) -> str:
        """Open a sound output for the noise of a study, or close it if there is none; returns a description."""
        return await self._ask(do="mask", noise=noise, device=device)

    async def present(self, path: Path, share: float, *, masked: bool = False) -> dict[str, Any]:
        """Play a drive of a study while the controlling page is visible; SilentFramesError if frames were late."""
        page = self._experimenter()
        found = await self.admit_trial(path, share)
        report = await self._sound(page, path.name, do="play", admission=found["number"], output="", masked=masked)
        if report.get("gap"):
            raise SilentFramesError(
                f"array: expected every frame in time, {report['late']} were late after {report['gap']:.3f} s of "
                "silence; close other programs and present it again"
            )
        return report

    async def quiet(self, seconds: float, *, masked: bool = False) -> None:
        """Present silence of the given length with the same noise."""
        await self._sound(self._experimenter(), "silence", do="quiet", seconds=seconds, masked=masked)

    def _experimenter(self) -> Page:
        self._busy()
        page = self._store.pages.get(self._store.control.holder)
        if page is None or not page.visible or time.monotonic() - page.last_alive > ALIVE:
            raise DeviceStateError(
                "play: expected the experimenter's page to be visible, it is hidden or closed; show it"
            )
        return page

    async def _sound(self, page: Page, what: str, **order: Any) -> Any:
        """Arm for a page, run a request of the player, and disarm in any case."""
        self._controls = page.number
        leave = self.permit.arm(lasts=ALIVE)
        self._show(state="plays", take=what, done=0, total=0, said="")
        try:
            report = await self._ask(leave=leave, **order)
        except MidairError as wrong:
            self._show(state="ready", emitting=False, said=str(wrong))
            raise
        finally:
            self.permit.disarm()
        self._show(state="ready", emitting=False, said="played to its end")
        return report

    async def lend(self, page: Page, what: str) -> LeaseToken:
        """Lend the array to another process and arm it, until `take_back`; DeviceStateError if something plays."""
        self._busy()
        self._seen(page)
        self._show(state="plays", take=what, done=0, total=0, said="")
        try:
            await self._ask(do="let go")
            self._seen(page)
        except MidairError:
            await self._open()
            raise
        self._controls = page.number
        return self.permit.arm(lasts=ALIVE)

    async def take_back(self, said: str) -> None:
        """Open the array again after the process that borrowed it has ended."""
        self.permit.disarm()
        self._show(state="opens", emitting=False)
        await self._open()
        self._show(said=said)

    def emits(self, emitting: bool) -> None:
        """Show whether a borrowed array emits sound."""
        self._show(emitting=emitting)

    def _seen(self, page: Page) -> None:
        if not page.visible or time.monotonic() - page.last_alive > ALIVE:
            raise DeviceStateError("play: expected the page to be visible, it is hidden or does not respond; show it")

    def stop(self, _: Page, __: NoArguments) -> bool:
        """STOP, from any page: revokes the lease; the player's thread silences the array within milliseconds."""
        self.permit.stop()
        return True

    def take_control(self, page: Page, _: NoArguments) -> bool:
        """Request control for a page."""
        had = self._store.control.take(page.number)
        self._store.show_control()
        return had

    def give_control(self, page: Page, _: NoArguments) -> bool:
        """Hand over control; anything that the former holder armed ends."""
        control = self._store.control
        control.give(page.number, to=control.asking)
        self.permit.stop()
        self._store.show_control()
        return True

    def refuse_control(self, page: Page, _: NoArguments) -> bool:
        """Keep control."""
        self._store.control.refuse(page.number)
        self._store.show_control()
        return True

    def _beside(self, output: Any) -> Any:
        return output.with_name(f".{output.name.removesuffix('.h5')}.partial.h5")

    def _busy(self) -> None:
        if self._state["state"] == "plays":
            raise DeviceStateError("play: expected an idle array, something plays; press STOP or wait for its end")

    def _alive(self, page: Page) -> None:
        """Renew the lease for the page in control while it is visible."""
        if page.number != self._controls or page.number != self._store.control.holder:
            return
        if page.visible:
            self.permit.renew(lasts=ALIVE)
        elif self.permit.armed:
            self.permit.stop()

    def _left(self, page: Page, _: bool) -> None:
        """Stop at once if the page that armed has gone."""
        if page.number == self._controls:
            self.permit.stop()

    async def _ask(self, **order: Any) -> Any:
        number = next(self._numbers)
        done: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._waiting[number] = done
        try:
            self._player.send({"id": number, **order})
            return await done
        finally:
            self._waiting.pop(number, None)

    def _forward(self, said: dict[str, Any]) -> None:
        self._later(self._on_message, said)

    def _on_message(self, said: dict[str, Any]) -> None:
        """Handle a message of the player."""
        match said["kind"]:
            case "ready":
                self._show(state="opens")
                self._opening = asyncio.ensure_future(self._open())
            case "answer":
                if (waits := self._waiting.get(said["id"])) is not None and not waits.done():
                    waits.set_result(said["value"])
            case "wrong":
                if (waits := self._waiting.get(said["id"])) is not None and not waits.done():
                    waits.set_exception(_error_class(said["of"])(said["error"]))
            case "sounds":
                self._show(done=said["done"], total=said["total"], emitting=said["emitting"])
            case "stopped":
                self._show(emitting=False, said="silenced")
            case _:
                for waits in self._waiting.values():
                    if not waits.done():
                        waits.set_exception(
                            DeviceStateError("player: the process ended; the failsafe of the array has silenced it")
                        )
                self._show(state="starts", emitting=False, said="the player ended unexpectedly and is starting again")

    async def _open(self) -> None:
        for left in reversed(range(ATTEMPTS)):
            try:
                found = await self._ask(do="open")
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


def _error_class(name: str) -> type[MidairError]:
    """Return the error class of a name, so that callers can distinguish errors of the player."""
    kind = getattr(errors, name, InputError)
    return kind if isinstance(kind, type) and issubclass(kind, MidairError) else InputError
