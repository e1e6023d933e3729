"""The air of the room: one statement for all panels, typed or measured by a thermometer."""

import asyncio
import re
import threading
from collections.abc import Callable
from typing import Any

from pydantic import Field

from midair.devices import Thermometer, log_drift
from midair.errors import DeviceError, InputError
from midair.model import Medium
from midair.rig import DRIFT, thermometer_named
from midair.studio.studio_state import Arguments, Page, StudioState

TYPED = re.compile(r"\s*([-+]?\d+(?:\.\d+)?)\s*(?:°?\s*C)?\s*")
"""A temperature in degrees Celsius as it is typed."""


class AirForm(Arguments):
    """Air of the room, as it is typed."""

    temperature: str = Field(default="", max_length=300)
    humidity: float | None = Field(default=None, ge=0, le=100)


class RoomAir:
    """The stated air of the room; a thread reads a thermometer, and `later` runs a function on the event loop."""

    def __init__(self, store: StudioState, later: Callable[..., None], *, every: float = 1.0) -> None:
        self._store, self._later, self._every = store, later, every
        self._over = threading.Event()
        self._plays: tuple[str, float] | None = None
        self._state: dict[str, Any] = {"drift": DRIFT, "default": Medium.at().degrees}
        store.offer("air", "state", self.state, AirForm)
        self._show(temperature="", humidity=None, degrees=None, problem="")

    @property
    def stated(self) -> dict[str, float]:
        """The stated temperature in degrees Celsius and humidity, by the names of the settings of a drive."""
        humidity = self._state["humidity"]
        found = {"temperature": self._state["degrees"], "humidity": None if humidity is None else humidity / 100}
        return {name: value for name, value in found.items() if value is not None}

    @property
    def medium(self) -> Medium | None:
        """The stated air; None if no temperature is stated."""
        return Medium.at(**self.stated) if self.stated else None

    async def state(self, _: Page, order: AirForm) -> bool:
        """State the air; an empty temperature takes the statement back."""
        text = order.temperature.strip()
        thermometer = None
        if not text:
            if order.humidity is not None:
                raise InputError("humidity: expected a temperature with it, got none")
            degrees = None
        elif ":" in text:
            thermometer = thermometer_named(text)
            degrees = round(await asyncio.to_thread(thermometer.read), 2)
        elif (found := TYPED.fullmatch(text)) is not None:
            degrees = float(found[1])
        else:
            raise InputError(
                f"temperature: expected degrees Celsius such as 22C, lsl:NAME, serial:PORT or file:PATH, got {text!r}"
            )
        if degrees is not None:
            Medium.at(temperature=degrees)  # raises outside of the range of its formulas
        self.close()
        self._show(temperature=text, humidity=order.humidity, degrees=degrees, problem="")
        if thermometer is not None:
            self._over = over = threading.Event()
            threading.Thread(target=self._poll, args=(thermometer, over), name="studio air", daemon=True).start()
        return True

    def plays(self, device: str = "", solved: float = 0.0) -> None:
        """Log one drift from the temperature of the drive that plays on a device; without a device nothing plays."""
        self._plays = (device, solved) if device not in ("", "virtual") else None
        self._log_drift()

    def close(self) -> None:
        """Stop reading the thermometer."""
        self._over.set()

    def _poll(self, thermometer: Thermometer, over: threading.Event) -> None:
        while not over.wait(self._every):
            try:
                changes: dict[str, Any] = {"degrees": round(thermometer.read(), 2), "problem": ""}
            except DeviceError as wrong:
                changes = {"problem": f"the temperature is no longer checked: {wrong}"}
            self._later(self._measured, over, changes)
        thermometer.close()

    def _measured(self, over: threading.Event, changes: dict[str, Any]) -> None:
        if not over.is_set():
            self._show(**changes)
            self._log_drift()

    def _log_drift(self) -> None:
        now = self._state["degrees"]
        if self._plays is None or now is None or ":" not in self._state["temperature"]:
            return
        device, solved = self._plays
        if abs(now - solved) >= DRIFT:
            self._plays = None
            log_drift(device, self._state["temperature"], measured=now, solved=solved)

    def _show(self, **changes: Any) -> None:
        self._state = {**self._state, **changes}
        self._store.put(air=self._state)
