"""The air that carries the sound, and the surface that reflects it."""

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
"""Permitted speeds of sound of a drive, in m/s: a wider range than air from -50 to 65 degrees Celsius."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Medium:
    """Properties of the air, and reflection of the surface (paper, 2.1).

    Raises InputError if a constant is out of range, or does not agree with the stated temperature and humidity.
    """

    density: float = 1.25
    """rho, in kg/m3."""
    speed: float = 340.0
    """Speed of sound c, in m/s; the paper's 340 m/s is that of air at 14 degrees Celsius."""
    attenuation: float = 0.15
    """Amplitude attenuation beta, in Np/m (ISO 9613-1: .15 at 40 kHz, 20-25 °C, 40-60 % humidity)."""
    alpha: float = 2.0
    """1 + R, with R the power reflection coefficient of the surface: 1 to 2."""
    temperature: float | None = None
    """Temperature in degrees Celsius if the medium was made by `at`; None if its constants were stated."""
    humidity: float | None = None
    """Relative humidity, 0 to 1; None if the constants were stated."""

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
        """Air of a given temperature: speed of sound by Cramer (1993), attenuation by ISO 9613-1, density of moist air.

        Parameters
        ----------
        temperature : float
            In degrees Celsius, 0 to 50.
        humidity : float
            Relative humidity, 0 to 1.
        pressure : float
            Air pressure, in Pa.
        frequency : float
            Frequency of the sound, in Hz, for the attenuation.
        alpha : float
            1 + R of the surface.

        Raises
        ------
        InputError
            If the air is outside the range of the formulas.
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
        """Temperature in degrees Celsius: the stated one, or that with this speed of sound at 50 % humidity."""
        return temperature_of(self.speed) if self.temperature is None else self.temperature

    def check_speed(self, source: str = "drive") -> None:
        """Raise InputError unless the speed of sound is 300 to 370 m/s."""
        if not SLOWEST <= self.speed <= FASTEST:
            raise InputError(
                f"{source}: expected a speed of sound of {SLOWEST:g} to {FASTEST:g} m/s, as in air, "
                f"got {self.speed:g} m/s; solve the target again for the temperature of the air"
            )

    def warmer(self, degrees: float) -> "Medium":
        """The same air, warmer by `degrees` (colder if negative).

        If the constants were stated, only the speed of sound changes: by as much as at 50 % humidity. Raises InputError
        if the result is outside the range of the formulas.
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
    """Raise unless the speed of sound agrees with temperature and humidity at some permitted air pressure."""
    if temperature is None and humidity is None:
        return
    if temperature is None or humidity is None:
        raise InputError("air: expected temperature and humidity together, got only one of them; use Medium.at()")
    check_air(temperature, humidity, STANDARD_PRESSURE)
    ends = [speed_of_sound(temperature, humidity, pressure) for pressure in (LOWEST_PRESSURE, HIGHEST_PRESSURE)]
    # Tolerance for a rounded speed of sound.
    if not min(ends) - 0.05 <= speed <= max(ends) + 0.05:
        raise InputError(
            f"air: expected a speed of sound of {min(ends):.1f} to {max(ends):.1f} m/s at {temperature:g} degrees "
            f"Celsius, got {speed:g}; compute it with Medium.at()"
        )
