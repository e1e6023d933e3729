"""Options for the air of the room, and the exposure limits, and messages about both."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from midair import devices, files
from midair.cli.console import err, print_note
from midair.cli.options import Time, quantity
from midair.errors import InputError
from midair.model import Medium
from midair.physics import ExposureProfile


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class AirOptions:
    """Air of the room."""

    temperature: Annotated[float | None, quantity("C")] = None
    """Air temperature in the room, such as 22C."""
    humidity: Annotated[float | None, quantity("%")] = None
    """Relative humidity of the room, such as 50%; needs --temperature. [default: 50%]"""

    def medium(self) -> Medium | None:
        """The stated air; None if neither option is given."""
        if self.temperature is None:
            if self.humidity is not None:
                raise InputError("--humidity: expected --temperature with it, got none")
            return None
        return Medium.at(temperature=self.temperature, humidity=0.5 if self.humidity is None else self.humidity)

    def assumed(self) -> Medium:
        """The stated air, or 22 °C and 50 % humidity; printed on stderr."""
        room = self.medium()
        print_air(medium := room or Medium.at(), stated=room is not None)
        return medium


def print_air(medium: Medium, *, stated: bool) -> None:
    """Print on stderr which air a computation assumes; as a warning if it was not stated."""
    whose = "" if stated else ", assumed; state yours: --temperature, --humidity"
    print_note(f"air: {medium}{whose}", warn=not stated)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ProfileOptions:
    """Exposure limits."""

    profile: str = files.DEFAULT_PROFILE
    """Name of the exposure profile."""
    profiles: Path | None = None
    """TOML file of exposure profiles. [default: the profiles of midair]"""
    ear_protection: Annotated[float, quantity("dB")] = 0.0
    """Attenuation at 40 kHz, as you state it, of ear protection that everyone in the room wears; logged."""

    def chosen(self) -> ExposureProfile:
        """The profile behind the stated ear protection."""
        return files.profile_named(self.profile, self.profiles).behind(self.ear_protection)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ExposureOptions(ProfileOptions):
    """Exposure limits for a real array or its emulator, and what to do above them."""

    attenuate: bool = False
    """Reduce the level of drives that exceed the profile until they meet it."""
    override_exposure: str | None = None
    """Play above the profile; give the name of the responsible person, which is logged."""

    def choices(self, room: Medium | None = None) -> "devices.ExposureChoices":
        """The options as one value, with the stated air of the room."""
        return devices.ExposureChoices(
            profile=self.chosen(), attenuate=self.attenuate, override=self.override_exposure, room=room
        )


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RoomOptions(AirOptions, ExposureOptions):
    """Air of the room, and exposure limits in it."""

    def limits(self) -> "devices.ExposureChoices":
        """The exposure limits in the stated air."""
        return self.choices(self.medium())


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class HeatOptions:
    """Action if a unit of the array reports that it is too hot."""

    when_hot: Literal["stop", "wait"] = "stop"
    """stop: end with status 1. wait: pause in silence, and continue once all units have been cool for a second."""
    cooling_limit: Time = 600.0
    """Longest pause of --when-hot wait; playback then ends with status 1."""

    def cooling(self) -> "devices.Cooling | None":
        """Permission to wait; None to stop. Pauses are printed on stderr."""
        if self.when_hot == "stop":
            return None
        return devices.Cooling(limit=self.cooling_limit, report=lambda text: err().print(f"midair: {text}"))
