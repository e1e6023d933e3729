"""Panel Live: plays the sensor's signal as it comes, after an exposure check and a held button."""

import asyncio
import itertools
from typing import Any

from pydantic import Field

from midair.devices import ExposureChoices
from midair.errors import DeviceStateError, InputError, MidairError
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import Acoustics
from midair.rig import LiveMapping, LiveSettings, Subject, take_path
from midair.studio.live_run import REMEMBERED
from midair.studio.panels.panel import WEB, Panel, PanelContext
from midair.studio.panels.record_panel import Feed, VisibleRange
from midair.studio.studio_state import Arguments, Page, declared


class CheckLive(Arguments):
    """Settings to check before live touch starts."""

    sensor: str = Field(min_length=3, max_length=300, pattern=r"^[a-z]+:")
    calibration: str = Field(default="", max_length=1000)
    mapping: LiveMapping = "half-wave"
    delay_ms: float = declared(LiveSettings, "delay", 1e3)
    hold_ms: float = declared(LiveSettings, "hold", 1e3)
    total_ms: float | None = declared(LiveSettings, "latency", 1e3)
    gain: float = declared(LiveSettings, "gain")
    height_mm: float = declared(LiveSettings, "height", 1e3)
    level: float = declared(LiveSettings, "level")
    follow: str = Field(default="", max_length=300)
    latency_ms: float | None = Field(default=None, ge=0, le=1000)
    profile: str = Field(default="", max_length=100)
    attenuate: bool = False
    override: str = Field(default="", max_length=200)


class BeginLive(Arguments):
    """Start checked settings, after the button was held."""

    clearance: int


class SetLevel(Arguments):
    """Share of the checked level to play now."""

    share: float = Field(gt=0, le=1)


class KeepLast(Arguments):
    """Save the last seconds as a take."""

    seconds: float = Field(default=REMEMBERED, gt=0, le=REMEMBERED)


class LivePanel(Panel):
    """Live touch: borrows the array, and the sensor of the panel Record."""

    name, title, script, place = "live", "Live", WEB / "room-live.js", 8

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context)
        self._playing = context.playing
        self.feed = Feed()
        self._playing.live = self._on_message
        self._runs = itertools.count(1)
        self._checked: dict[int, dict[str, Any]] = {}
        self._run: asyncio.Task[None] | None = None
        self._began = asyncio.Event()
        store = context.store
        self._offer(sight=VisibleRange, watchers=True)
        self._offer(check=CheckLive, begin=BeginLive, turn=SetLevel, keep=KeepLast, end=Arguments)
        store.alive.append(self.feed.remind)
        self._show(state="idle", said="", share=1.0, take=None, calibrations=[])

    def sight(self, page: Page, order: VisibleRange) -> bool:
        """Start or stop sending frames to a page."""
        page.credit = 24
        (self.feed.enter if order.shown else self.feed.leave)(page)
        if order.shown:
            self._show(calibrations=self._takes.folder.names(".calibration.h5"))
        return True

    def left(self, page: Page) -> None:
        """Stop sending frames to a page that has gone."""
        self.feed.leave(page)

    async def check(self, _: Page, order: CheckLive) -> Any:
        """Return the worst-case exposure of a level."""
        self._idle()
        room = self._context.air.medium
        given = order.model_dump(include={"sensor", "mapping", "gain", "level"})
        request: dict[str, Any] = {
            **given,
            "device": self._playing.device,
            "array_calibration": self._context.array_calibration,
            "delay": 1e-3 * order.delay_ms,
            "hold": 1e-3 * order.hold_ms,
            "latency": None if order.total_ms is None else 1e-3 * order.total_ms,
            "height": 1e-3 * order.height_mm,
            "follow": order.follow.strip() or None,
            "tracker_latency": None if order.latency_ms is None else 1e-3 * order.latency_ms,
            "calibration": self._takes.folder.find(order.calibration) if order.calibration else None,
            "exposure": ExposureChoices(
                profile=profile_named(order.profile or DEFAULT_PROFILE),
                attenuate=order.attenuate,
                override=order.override.strip() or None,
                room=room,
            ),
            "acoustics": None if room is None else Acoustics(medium=room),
            "seed": self._context.seed,
        }
        found = await self._playing.check_live(request)
        self._checked = {found["number"]: request} if found["number"] else {}
        return found

    async def begin(self, page: Page, order: BeginLive) -> Any:
        """Take the sensor, arm, and start; answers when it plays."""
        self._idle()
        request = self._checked.pop(order.clearance, None)
        if request is None:
            raise DeviceStateError("live: expected settings that were just checked; check the exposure again")
        self._playing.check_same_air(None if request["acoustics"] is None else request["acoustics"].medium)
        # From here on `end` and STOP of any page end it, although nothing plays yet.
        stops = self._playing.lease.stops
        self._show(state="opens", said="", share=1.0, take=None)
        self._began.clear()
        self._run = asyncio.create_task(self._play(page, order.clearance, request["sensor"], stops))
        began = asyncio.create_task(self._began.wait())
        await asyncio.wait((self._run, began), return_when=asyncio.FIRST_COMPLETED)
        began.cancel()
        if not self._began.is_set():
            self._run.result()  # raises why it did not begin
        return True

    async def _play(self, page: Page, number: int, sensor: str, stops: int) -> None:
        said = ""
        try:
            await self._context.panels["record"].release()
            self._store.put(live_goes=None)
            said = await self._playing.play_live(page, f"live {sensor}", number, stops=stops)
        except MidairError as wrong:
            said = str(wrong)
            if not self._began.is_set():
                raise
        finally:
            self._show(state="idle", said=said)

    def turn(self, _: Page, order: SetLevel) -> bool:
        """Set the share of the checked level; it can never be louder."""
        if self._state["state"] != "plays":
            raise DeviceStateError("live: expected running live touch, none is running; start it first")
        self._playing.lease.turn(order.share)
        self._show(share=order.share)
        return True

    async def keep(self, _: Page, order: KeepLast) -> Any:
        """Save the last seconds as a take that Reproduce opens."""
        about = self._store.state.get("live_about")
        if not about:
            raise InputError("keep: expected recorded frames, there are none yet; start live touch first")
        notes = Subject(object="live", surface=about["sensor"].partition(":")[2][:40])
        path = take_path(self._takes.folder.path, notes, repeats=1)
        found = await self._playing.keep_live(seconds=order.seconds, path=str(path), notes=dict(notes.notes))
        self._show(take=found)
        self._context.show_takes()
        return found

    def end(self, _: Page, __: Arguments) -> bool:
        """Fade out and end."""
        if self._state["state"] == "opens":
            self._playing.lease.stop()
        elif self._state["state"] == "plays":
            self._playing.end_live()
        return True

    def close(self) -> None:
        """Stop sending frames."""
        self.feed.close()

    def _idle(self) -> None:
        if self._state["state"] != "idle":
            raise DeviceStateError("live: expected no running live touch, one is running; end it, then start again")

    def _on_message(self, said: dict[str, Any]) -> None:
        match said["kind"]:
            case "frames":
                self.feed.add(said["data"])
            case "goes":
                self._store.put(live_goes={**(self._store.state.get("live_goes") or {}), **said["goes"]})
            case "began":
                # A new number makes the pages clear their pictures, also when the settings are the same.
                self._store.put(live_about={**said["about"], "run": next(self._runs)})
                self._show(state="plays")
                self._began.set()
            case _:
                self._show(said=said["text"])
