import pytest

from midair.errors import InputError, UnknownDeviceError
from midair.rig import stage_named


def test_a_port_with_its_rate():
    assert stage_named("grbl:/dev/ttyUSB0?baud=250000").name == "grbl:/dev/ttyUSB0"


@pytest.mark.parametrize("name", ["grbl", "grbl:", "marlin:COM3", ""])
def test_an_invalid_stage_name_is_refused(name):
    with pytest.raises(UnknownDeviceError, match="expected grbl:PORT"):
        stage_named(name)


@pytest.mark.parametrize("name", ["grbl:COM3?baud=fast", "grbl:COM3?baud=0", "grbl:COM3?speed=3"])
def test_unknown_options_are_refused(name):
    with pytest.raises(InputError, match="expected the option baud"):
        stage_named(name)
