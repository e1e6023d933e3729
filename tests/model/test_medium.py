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
