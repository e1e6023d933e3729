"""Properties of air compared with the figures in their sources."""

import math

import pytest

from midair.model import Medium
from midair.model.medium import attenuation, density, speed_of_sound, temperature_of


def test_warmer_air_is_that_of_its_temperature_and_stated_constants_keep_all_but_the_speed():
    air = {"humidity": 0.3, "alpha": 1.5}
    assert Medium.at(temperature=20, **air).warmer(2) == Medium.at(temperature=22, **air)
    assert Medium.at(temperature=22).warmer(0) == Medium.at(temperature=22)
    # Cramer's figure 1: about .6 m/s a degree.
    stated = Medium(density=1.1, attenuation=0.3)
    warm = stated.warmer(2)
    assert (warm.density, warm.attenuation, warm.temperature) == (1.1, 0.3, None)
    assert warm.speed == pytest.approx(341.24, abs=0.03)
    assert warm.warmer(-2).speed == pytest.approx(340.0, abs=1e-6)


def test_air_at_any_pressure_is_what_it_says():
    for pressure in (60e3, 101.325e3, 110e3):
        for air in ({"temperature": t, "humidity": h} for t, h in ((0.0, 0.0), (22.0, 0.5), (50.0, 1.0))):
            made = Medium.at(pressure=pressure, **air)
            assert Medium(speed=made.speed, **air).degrees == air["temperature"], (pressure, air)


# Cramer (1993), figure 1, read off: temperature (C), humidity, speed (m/s); dry air at three pressures below.
FIGURE_1 = [
    (0, 0.0047393, 331.5079),
    (0, 0.60032, 331.7063),
    (0, 0.99526, 331.9048),
    (10, 0.30332, 337.6984),
    (10, 0.9921, 338.1746),
    (20, 0.0078989, 343.3333),
    (20, 0.6019, 344.1667),
    (20, 0.98736, 344.6825),
    (30, 0.0047393, 349.1667),
    (30, 0.6019, 350.5556),
    (30, 0.98894, 351.5079),
]
PRESSURES = [(0, 75265.49, 331.4732), (10, 85088.5, 337.4554), (20, 95017.7, 343.3929), (30, 75053.1, 349.1)]

# ISO 9613-1:1993, table 1: temperature (C), frequency (Hz, exact midband), humidity, dB/km.
TABLE_1 = [
    (-20, 50, 0.10, 0.589),
    (-20, 800, 0.30, 4.92),
    (10, 100, 0.10, 0.585),
    (10, 1000, 0.10, 21.6),
    (20, 5000, 0.10, 133),
    (20, 5000, 0.80, 30.6),
    (20, 6300, 0.15, 175),
    (35, 4000, 0.60, 25.8),
    (50, 1000, 0.70, 8.03),
]


def test_speed_of_sound_and_temperature_as_cramer_has_them():
    """Within 300 ppm and what can be read off the figure."""
    temperatures, humidities, speeds = zip(*FIGURE_1, strict=True)
    assert list(map(speed_of_sound, temperatures, humidities)) == pytest.approx(speeds, abs=0.15)
    assert list(map(temperature_of, speeds, humidities)) == pytest.approx(temperatures, abs=0.3)
    found = [speed_of_sound(temperature, 0.0, pressure) for temperature, pressure, _ in PRESSURES]
    assert found == pytest.approx([speed for _, _, speed in PRESSURES], abs=0.1)
    # Section IV: 331.46 m/s +- 0.05 for standard dry air; 106 ppm more carbon dioxide take .009 of it.
    assert speed_of_sound(0.0, 0.0) == pytest.approx(331.46, abs=0.02)


def test_attenuation_and_density_of_moist_air_as_standards_tabulate_them():
    printed = [row[3] for row in TABLE_1]  # three digits
    # Note 5 of 6.4: the table is of exact frequencies.
    exact = [1000 * 10 ** (round(10 * math.log10(row[1] / 1000)) / 10) for row in TABLE_1]
    found = [attenuation(f, row[0], row[2]) * 20 / math.log(10) * 1000 for f, row in zip(exact, TABLE_1, strict=True)]
    assert found == pytest.approx(printed, rel=4e-3)
    # .15 Np/m at 40 kHz is the constant of `Medium`: 20 C at 50 %, 25 C at 60 %.
    assert attenuation(40e3, 20, 0.5) == pytest.approx(0.152, abs=5e-4)
    assert attenuation(40e3, 25, 0.6) == pytest.approx(0.151, abs=5e-4)
    # Davis (1992) gives 1.19929 kg/m3 at 20 C, 50 %, 101325 Pa with 400 ppm of carbon dioxide.
    assert density(20, 0.5) == pytest.approx(1.1993, rel=5e-4)
    assert density(20, 1.0) < density(20, 0.0)


def test_a_medium_at_a_temperature_has_all_of_it_within_the_range_of_air():
    assert str(Medium.at(temperature=200 / 9)) == "22.2 °C, 50 % humidity"
    medium = Medium.at(temperature=22.0, humidity=0.5)
    assert (medium.temperature, medium.humidity) == (22.0, 0.5)
    assert medium.speed == speed_of_sound(22, 0.5)
    assert medium.attenuation == attenuation(40e3, 22, 0.5)
    assert medium.density == density(22, 0.5)
    assert medium.alpha == 2.0
    assert (temperature_of(1e-3), temperature_of(1500.0)) == (pytest.approx(-50), pytest.approx(100))
