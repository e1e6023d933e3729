"""Names of boards, as `--device` takes them."""

import pytest

from midair.errors import InputError, MissingFileError
from midair.model import Placement
from midair.rig import array_named
from midair_openmpd import Board, array_of_boards


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("openmpd:/dev/ttyUSB0", 1),
        ("openmpd:COM3?board=none", 1),
        ("openmpd:COM3,COM4?board=none,none", 2),
    ],
)
def test_names_of_boards(name, count):
    array = array_named(name)
    assert array.gated
    assert not array.simulated
    assert array.name == name.partition("?")[0]
    assert array.array.same_as(array_of_boards(*[Board.nominal()] * count))


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
