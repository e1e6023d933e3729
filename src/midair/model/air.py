"""Speed of sound, attenuation and density of air at a given temperature, humidity and pressure."""

import math

from midair.errors import InputError

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
    if not 0 <= temperature <= 50:
        raise InputError(f"temperature: expected 0 to 50 degrees Celsius, got {temperature:g}")
    if not 0 <= humidity <= 1:
        raise InputError(f"humidity: expected 0 to 1 (0 % to 100 %), got {humidity:g}")
    if not LOWEST_PRESSURE <= pressure <= HIGHEST_PRESSURE:
        raise InputError(f"air pressure: expected {LOWEST_PRESSURE:.0f} to {HIGHEST_PRESSURE:.0f} Pa, got {pressure:g}")


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
