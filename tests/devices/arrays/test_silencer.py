import pytest

from midair.devices import silencer_named
from midair.errors import InputError


def test_choices_by_name():
    assert str(silencer_named("off", 1000.0)) == "off"
    assert str(silencer_named("default", 1000.0)) == "phase 1 ms, intensity 0.25 ms"
    with pytest.raises(InputError, match="off, quarter"):
        silencer_named("loud", 1000.0)


@pytest.mark.parametrize("choice", ["quarter", "half"])
def test_a_step_is_complete_within_its_part_of_a_frame_or_in_the_shortest_time_there_is(choice):
    for rate in (100.0, 1000.0, 4000.0, 40e3):
        chosen = silencer_named(choice, rate)
        assert 25e-6 <= chosen.phase <= min(1e-3, max(25e-6, 0.5 / rate))
        assert chosen.phase / 25e-6 == pytest.approx(round(chosen.phase / 25e-6))
