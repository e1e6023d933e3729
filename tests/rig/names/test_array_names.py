import pytest

from midair.errors import InputError, MissingFileError, UnknownDeviceError
from midair.model import Placement, TransducerArray
from midair.rig.names.array_names import array_named, array_of_kind

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
        ("autd3:[::1]:50000", True),
        ("autd3:[fe80::1]:44336", False),
        ("autd3-simulator", True),
        ("autd3-simulator:5000", True),
        ("autd3-server", False),
        ("autd3-server:5000", False),
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


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("openmpd:/dev/ttyUSB0", "openmpd"),
        ("openmpd:COM3?board=none", "openmpd"),
        ("openmpd:COM3,COM4?board=none,none", "openmpd-twin"),
    ],
)
def test_names_of_boards(name, kind):
    array = array_named(name)
    assert array.gated
    assert not array.simulated
    assert array.name == name.partition("?")[0]
    assert array.array.same_as(array_of_kind(kind))


def test_invalid_names_of_boards():
    with pytest.raises(InputError, match="expected no placement"):
        array_named("openmpd:COM3", Placement.grid())
    with pytest.raises(InputError, match="expected the option board, got baud"):
        array_named("openmpd:COM3?baud=9600")
    with pytest.raises(InputError, match="each of 2 ports, got 1"):
        array_named("openmpd:COM3,COM4?board=none")
    with pytest.raises(InputError, match="one board, or two face to face, got 3"):
        array_named("openmpd:a,b,c")
    with pytest.raises(MissingFileError, match=r"board_N\.pat"):
        array_named("openmpd:COM3?board=nowhere.pat")


def test_kinds_of_arrays_that_can_be_solved_for():
    assert array_of_kind("autd3").same_as(ARRAY)
    assert (array_of_kind("openmpd").count, array_of_kind("openmpd-twin").count) == (256, 512)


@pytest.mark.parametrize("name", ["", "openmpd", "openmpd:", "autd9", "autd3:", "autd3-server:", "pyautd3:", "soem"])
def test_unknown_names(name):
    with pytest.raises(UnknownDeviceError, match="expected virtual, autd3"):
        array_named(name)
