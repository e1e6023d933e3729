"""The air that carries the sound, the surface that reflects it, and the directivity of what radiates it."""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

from midair.errors import InputError
from midair.validation import one_of, positive, within

STANDARD_PRESSURE = 101.325e3
"""One standard atmosphere, in Pa."""

LOWEST_PRESSURE, HIGHEST_PRESSURE = 60e3, 110e3
"""Range of air pressure, in Pa, in which the formulas are used."""

_KELVIN = 273.15
_CARBON_DIOXIDE = 420e-6  # mole fraction; 100 ppm change the speed of sound by 0.009 m/s


def check_air(temperature: float, humidity: float, pressure: float) -> None:
    """Raise InputError unless the formulas hold: temperature 0 to 50 degrees Celsius, humidity 0 to 1, pressure in Pa.

    Cramer's fit is stated for 0 to 30 degrees Celsius and 75 to 102 kPa.
    """
    within(temperature, "temperature", 0, 50, unit="degrees Celsius")
    within(humidity, "humidity", 0, 1, advice="1 is 100 %")
    within(pressure, "air pressure", LOWEST_PRESSURE, HIGHEST_PRESSURE, unit="Pa")


def vapour_fraction(temperature: float, humidity: float, pressure: float = STANDARD_PRESSURE) -> float:
    """Mole fraction of water vapour: saturation pressure and enhancement factor of Davis (Metrologia 29, 1992)."""
    kelvin = temperature + _KELVIN
    saturated = math.exp(1.2378847e-5 * kelvin**2 - 1.9121316e-2 * kelvin + 33.93711047 - 6.3431645e3 / kelvin)
    enhancement = 1.00062 + 3.14e-8 * pressure + 5.6e-7 * temperature**2
    return humidity * enhancement * saturated / pressure


def speed_of_sound(temperature: float, humidity: float, pressure: float = STANDARD_PRESSURE) -> float:
    """Speed of sound at zero frequency, in m/s: Cramer (J. Acoust. Soc. Am. 93, 1993), eq. 15 and table III.

    Stated accuracy: 300 parts per million, .1 m/s. Dispersion adds less than .1 m/s at 40 kHz and is neglected.
    """
    t, p, water, carbon = temperature, pressure, vapour_fraction(temperature, humidity, pressure), _CARBON_DIOXIDE
    return (
        331.5024
        + 0.603055 * t
        - 0.000528 * t**2
        + (51.471935 + 0.1495874 * t - 0.000782 * t**2) * water
        + (-1.82e-7 + 3.73e-8 * t - 2.93e-10 * t**2) * p
        + (-85.20931 - 0.228525 * t + 5.91e-5 * t**2) * carbon
        - 2.835149 * water**2
        - 2.15e-13 * p**2
        + 29.179762 * carbon**2
        + 0.000486 * water * p * carbon
    )


def temperature_of(speed: float, humidity: float = 0.5) -> float:
    """Temperature, in degrees Celsius, at which the speed of sound at one atmosphere is `speed`, in m/s.

    Limited to -50 to 100 degrees, where `speed_of_sound` increases monotonically for any humidity up to 1.
    """
    low, high = -50.0, 100.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if speed_of_sound(middle, humidity) < speed else (low, middle)
    return (low + high) / 2


def attenuation(frequency: float, temperature: float, humidity: float, pressure: float = STANDARD_PRESSURE) -> float:
    """Amplitude attenuation of a pure tone, in Np/m: ISO 9613-1:1993, eqs. 3 to 5 and B.2, B.3.

    Stated accuracy: 10 % for a frequency over pressure of 4e-4 to 10 Hz/Pa, which includes 40 kHz at one atmosphere.
    The formulas hold from -20 degrees Celsius on.
    """
    kelvin, ratio = temperature + _KELVIN, pressure / STANDARD_PRESSURE
    warm = kelvin / 293.15
    saturated = 10 ** (-6.8346 * (273.16 / kelvin) ** 1.261 + 4.6151)
    h = 100 * humidity * saturated / ratio  # molar concentration of water vapour, in %
    oxygen = ratio * (24 + 4.04e4 * h * (0.02 + h) / (0.391 + h))
    nitrogen = ratio * warm**-0.5 * (9 + 280 * h * math.exp(-4.170 * (warm ** (-1 / 3) - 1)))
    relaxed = 0.01275 * math.exp(-2239.1 / kelvin) / (oxygen + frequency**2 / oxygen)
    relaxed += 0.1068 * math.exp(-3352.0 / kelvin) / (nitrogen + frequency**2 / nitrogen)
    # The standard's factor 8.686 turns Np into dB; without it the formula gives Np/m.
    return frequency**2 * (1.84e-11 / ratio * math.sqrt(warm) + warm**-2.5 * relaxed)


def density(temperature: float, humidity: float, pressure: float = STANDARD_PRESSURE) -> float:
    """Density of moist air, in kg/m3: the ideal gas law with the molar masses of Davis (Metrologia 29, 1992).

    Compressibility, .04 %, is neglected.
    """
    water = vapour_fraction(temperature, humidity, pressure)
    return pressure * 28.9635e-3 / (8.314462618 * (temperature + _KELVIN)) * (1 - 0.3780 * water)


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
        within(self.speed, "speed", 100, 2000, unit="m/s", advice="air has about 340")
        within(self.attenuation, "attenuation", 0, unit="Np/m")
        within(self.alpha, "alpha", 1, 2, advice="it is 1 + the power reflection coefficient")
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

        `temperature` is in degrees Celsius, 0 to 50; `humidity` is relative, 0 to 1; `pressure` is that of the air, in
        Pa; `frequency` that of the sound, in Hz, for the attenuation; `alpha` is 1 + R of the surface. Raises
        InputError if the air is outside the range of the formulas.
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
        return f"{self.temperature:.3g} °C, {100 * self.humidity:g} % humidity"


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


Directivity = Literal["point", "piston", "t4010a1"]
"""Directivity D(theta) in eq. (3) of the paper: omnidirectional, a circular piston in a baffle, or the measured T4010A1
of AUTD3."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Acoustics:
    """Settings of a transfer matrix apart from positions; a drive stores those that it was solved for."""

    medium: Medium = field(default_factory=Medium)
    """The air, and the surface that reflects the sound."""
    directivity: Directivity = "t4010a1"
    """Directivity of every transducer."""

    def __post_init__(self) -> None:
        one_of(self.directivity, Directivity, "directivity")
