"""The air that sound goes through and the surface that it pushes."""

from dataclasses import dataclass, replace

from midair.errors import InputError
from midair.model.air import (
    HIGHEST_PRESSURE,
    LOWEST_PRESSURE,
    STANDARD_PRESSURE,
    attenuation,
    check_air,
    density,
    speed_of_sound,
    temperature_of,
)
from midair.validation import positive

SLOWEST, FASTEST = 300.0, 370.0
"""Speeds of sound that the air of a drive may have, in m/s: more than those of air from -50 to 65 degrees Celsius."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Medium:
    """Air, and how much of the sound the surface in it reflects (paper, 2.1).

    Attributes
    ----------
    density : float
        rho, in kg/m3.
    speed : float
        Speed of sound c, in m/s; the paper's 340 m/s is that of air at 14 degrees Celsius.
    attenuation : float
        Amplitude attenuation beta, in Np/m (ISO 9613-1: .15 at 40 kHz, 20-25 °C, 40-60 % humidity).
    alpha : float
        1 + R, with R the power reflection coefficient of the surface: 1 to 2.
    temperature : float or None
        In degrees Celsius, where the medium was made by `at`; None where its constants were stated.
    humidity : float or None
        Relative, 0 to 1; likewise.

    Raises
    ------
    InputError
        If a constant is out of range, or is not that of air of the stated temperature and humidity.
    """

    density: float = 1.25
    speed: float = 340.0
    attenuation: float = 0.15
    alpha: float = 2.0
    temperature: float | None = None
    humidity: float | None = None

    def __post_init__(self) -> None:
        positive(self.density, "density", "kg/m3")
        positive(self.speed, "speed", "m/s")
        if not 0 <= self.attenuation < float("inf"):
            raise InputError(f"attenuation: expected 0 Np/m or more, got {self.attenuation:g}")
        if not 1 <= self.alpha <= 2:
            raise InputError(f"alpha: expected 1 to 2 (1 + power reflection coefficient), got {self.alpha:g}")
        _check_stated(self.temperature, self.humidity, self.speed)

    @classmethod
    def at(
        cls,
        *,
        temperature: float = 22.0,
        humidity: float = 0.5,
        pressure: float = STANDARD_PRESSURE,
        frequency: float = 40e3,
        alpha: float = 2.0,
    ) -> "Medium":
        """Air of a laboratory: speed of sound by Cramer (1993), attenuation by ISO 9613-1, density of moist air.

        Parameters
        ----------
        temperature : float
            In degrees Celsius, 0 to 50.
        humidity : float
            Relative, 0 to 1.
        pressure : float
            Of the air, in Pa.
        frequency : float
            At which sound weakens, in Hz.
        alpha : float
            1 + R of the surface.

        Raises
        ------
        InputError
            If the air is outside of what the formulas hold for.
        """
        check_air(temperature, humidity, pressure)
        return cls(
            density=density(temperature, humidity, pressure),
            speed=speed_of_sound(temperature, humidity, pressure),
            attenuation=attenuation(frequency, temperature, humidity, pressure),
            alpha=alpha,
            temperature=float(temperature),
            humidity=float(humidity),
        )

    @property
    def degrees(self) -> float:
        """Its temperature, in degrees Celsius: the stated one, or that at which sound is as fast in half-dry air."""
        return temperature_of(self.speed) if self.temperature is None else self.temperature

    def check_speed(self, source: str = "drive") -> None:
        """Refuse a speed of sound that no room has.

        Raises
        ------
        InputError
            If it is outside of 300 to 370 m/s.
        """
        if not SLOWEST <= self.speed <= FASTEST:
            raise InputError(
                f"{source}: expected a speed of sound of {SLOWEST:g} to {FASTEST:g} m/s, as in air, "
                f"got {self.speed:g} m/s; solve the target again for the air of the room"
            )

    def warmer(self, degrees: float) -> "Medium":
        """The same air, so much warmer or, below 0, colder.

        Of air whose constants were stated, the speed of sound alone changes: by as much as that of a laboratory's.

        Raises
        ------
        InputError
            If it would be outside of what the formulas hold for.
        """
        if self.temperature is not None and self.humidity is not None:
            return Medium.at(temperature=self.temperature + degrees, humidity=self.humidity, alpha=self.alpha)
        change = speed_of_sound(self.degrees + degrees, 0.5) - speed_of_sound(self.degrees, 0.5)
        return replace(self, speed=self.speed + change)

    def __str__(self) -> str:
        if self.temperature is None or self.humidity is None:
            return f"{self.speed:g} m/s ({self.degrees:.0f} °C)"
        return f"{self.temperature:g} °C, {100 * self.humidity:g} % humidity"


def _check_stated(temperature: float | None, humidity: float | None, speed: float) -> None:
    """Refuse a temperature beside a speed of sound that no air of that temperature has."""
    if temperature is None and humidity is None:
        return
    if temperature is None or humidity is None:
        raise InputError("air: expected temperature and humidity together, got one of them; Medium.at() knows the rest")
    check_air(temperature, humidity, STANDARD_PRESSURE)
    ends = [speed_of_sound(temperature, humidity, pressure) for pressure in (LOWEST_PRESSURE, HIGHEST_PRESSURE)]
    # A digit more than a person would write down.
    if not min(ends) - 0.05 <= speed <= max(ends) + 0.05:
        raise InputError(
            f"air: expected a speed of sound of {min(ends):.1f} to {max(ends):.1f} m/s at {temperature:g} degrees "
            f"Celsius, got {speed:g}; Medium.at() works it out"
        )
