"""The air of the room: one statement for all panels."""

import re

from pydantic import Field

from midair.errors import InputError
from midair.model import Medium
from midair.studio.studio_state import Arguments, Page, StudioState

TYPED = re.compile(r"\s*([-+]?\d+(?:\.\d+)?)\s*(?:°?\s*C)?\s*")
"""A temperature in degrees Celsius as it is typed."""


class AirForm(Arguments):
    """Air of the room, as it is typed."""

    temperature: str = Field(default="", max_length=20)
    humidity: float | None = Field(default=None, ge=0, le=100)


def degrees_of(medium: Medium | None) -> float | None:
    """Temperature of stated air in degrees Celsius; None if none is stated."""
    return None if medium is None else medium.degrees


class RoomAir:
    """The air of the room as it was typed."""

    def __init__(self, store: StudioState) -> None:
        self._store = store
        store.offer("air", "state", self.state, AirForm)
        self._show("", None, None)

    @property
    def stated(self) -> dict[str, float]:
        """The stated temperature in degrees Celsius and humidity, by the names of the settings of a drive."""
        air = self._store.state["air"]
        found = {"temperature": air["degrees"], "humidity": None if air["humidity"] is None else air["humidity"] / 100}
        return {name: value for name, value in found.items() if value is not None}

    @property
    def medium(self) -> Medium | None:
        """The stated air; None if no temperature is stated."""
        return Medium.at(**self.stated) if self.stated else None

    async def state(self, _: Page, order: AirForm) -> bool:
        """State the air; an empty temperature takes the statement back."""
        text = order.temperature.strip()
        if not text:
            if order.humidity is not None:
                raise InputError("humidity: expected a temperature with it, got none")
            self._show("", None, None)
            return True
        found = TYPED.fullmatch(text)
        if found is None:
            raise InputError(f"temperature: expected degrees Celsius such as 22C, got {text!r}")
        degrees = float(found[1])
        Medium.at(temperature=degrees)  # raises outside of the range of its formulas
        self._show(text, degrees, order.humidity)
        return True

    def _show(self, text: str, degrees: float | None, humidity: float | None) -> None:
        default = Medium.at().degrees
        self._store.put(air={"temperature": text, "degrees": degrees, "humidity": humidity, "default": default})
