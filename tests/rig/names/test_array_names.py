import pytest

from midair.errors import UnknownDeviceError
from midair.model import TransducerArray
from midair.rig.names.array_names import array_named

ARRAY = TransducerArray.autd3()


@pytest.fixture(autouse=True)
def _state(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))


@pytest.mark.parametrize(
    ("name", "simulated"),
    [
        ("autd3", False),
        ("autd3:eth0", False),
        ("autd3:emulator", True),
        ("pyautd3", False),
        ("pyautd3:eth0", False),
        ("pyautd3:twincat", False),
        ("pyautd3:remote:127.0.0.1:8080", False),
        ("pyautd3:audit", True),
        ("pyautd3:nop", True),
    ],
)
def test_names_of_arrays(name, simulated):
    array = array_named(name)
    assert array.simulated is simulated
    assert array.gated
    assert array.array.same_as(ARRAY)


@pytest.mark.parametrize("name", ["", "virtual", "autd9", "autd3:", "pyautd3:", "soem"])
def test_names_that_nothing_answers_to(name):
    with pytest.raises(UnknownDeviceError, match="expected virtual, autd3"):
        array_named(name)
