import pytest

from midair.errors import InputError
from midair.model import Medium


def test_the_papers_air():
    medium = Medium()
    assert (medium.density, medium.speed, medium.attenuation, medium.alpha) == (1.25, 340.0, 0.15, 2.0)


def test_no_attenuation_and_no_reflection_are_possible():
    assert Medium(attenuation=0, alpha=1).attenuation == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"density": 0.0},
        {"speed": -340.0},
        {"speed": float("nan")},
        {"attenuation": -0.1},
        {"attenuation": float("inf")},
        {"alpha": 0.9},
        {"alpha": 2.1},
        {"alpha": float("nan")},
    ],
    ids=str,
)
def test_impossible_air_is_refused(wrong):
    with pytest.raises(InputError, match=r"expected .*, got"):
        Medium(**wrong)


def test_the_papers_air_is_of_14_degrees():
    assert Medium().degrees == pytest.approx(13.6, abs=0.05)
    assert str(Medium()) == "340 m/s (14 °C)"
    assert str(Medium.at(temperature=22.5, humidity=0.35)) == "22.5 °C, 35 % humidity"


def test_warmer_air_is_that_of_its_temperature():
    assert Medium.at(temperature=20, humidity=0.3, alpha=1.5).warmer(2) == Medium.at(
        temperature=22, humidity=0.3, alpha=1.5
    )
    assert Medium.at(temperature=22).warmer(0) == Medium.at(temperature=22)


def test_stated_constants_keep_all_but_the_speed():
    """Cramer's figure 1: about .6 m/s a degree."""
    stated = Medium(density=1.1, attenuation=0.3)
    warm = stated.warmer(2)
    assert (warm.density, warm.attenuation, warm.temperature) == (1.1, 0.3, None)
    assert warm.speed == pytest.approx(341.24, abs=0.03)
    assert warm.warmer(-2).speed == pytest.approx(340.0, abs=1e-6)


@pytest.mark.parametrize("pressure", [60e3, 101.325e3, 110e3])
@pytest.mark.parametrize(("temperature", "humidity"), [(0.0, 0.0), (22.0, 0.5), (50.0, 1.0)])
def test_air_at_any_pressure_is_what_it_says(temperature, humidity, pressure):
    made = Medium.at(temperature=temperature, humidity=humidity, pressure=pressure)
    assert Medium(speed=made.speed, temperature=temperature, humidity=humidity).degrees == temperature


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"temperature": 22.0, "humidity": 0.5}, "345.2 to 345.7 m/s at 22 degrees Celsius, got 340"),
        ({"temperature": 22.0}, "temperature and humidity together"),
        ({"temperature": 1e300, "humidity": 0.5}, "0 to 50 degrees"),
        ({"temperature": float("nan"), "humidity": 0.5}, "0 to 50 degrees"),
        ({"temperature": 22.0, "humidity": 0.5, "speed": 1e300}, "got 1e"),
    ],
    ids=str,
)
def test_a_temperature_that_does_not_go_with_the_speed_is_refused(wrong, says):
    with pytest.raises(InputError, match=says):
        Medium(**wrong)
