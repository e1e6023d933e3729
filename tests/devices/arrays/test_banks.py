import pytest

from midair.devices.arrays.banks import UnitsState


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (UnitsState(), "not too hot"),
        (UnitsState(errors=()), "not too hot, no errors"),
        (UnitsState(hot=(0, 3), errors=("unit 1 counted failsafe 2 times",)), "unit 0 too hot, unit 3 too hot, unit 1"),
    ],
)
def test_a_state_lists_heat_and_errors_if_they_were_queried(state, words):
    assert str(state).startswith(words)
