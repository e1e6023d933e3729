import numpy as np
import pytest

from midair.errors import BrokenFileError, MissingFileError
from midair.files import load_board
from midair.model import Board


def written(path, **changed):
    """A board file in the makers' format, with its own offsets."""
    board = Board.nominal()
    lines = {
        "serial": "FT000000",
        "count": "256",
        "steps": "128",
        "places": "".join(f"({x:f}, {y:f}, {z:f})," for x, y, z in board.position),
        "pins": "".join(f"{pin}," for pin in board.pin),
        "offsets": "".join(f"{-180 + t % 7}," for t in range(256)),
        "factors": "".join(f"{1 - t / 512:f}," for t in range(256)),
    } | changed
    path.write_text("".join(f"{line}\n" for line in lines.values()), encoding="ascii")
    return path


def test_a_board_file_is_read_by_transducer(tmp_path):
    board = load_board(written(tmp_path / "board_7.pat"))
    assert board.serial == "FT000000"
    np.testing.assert_allclose(board.position, Board.nominal().position, atol=1e-9)
    np.testing.assert_array_equal(board.pin, Board.nominal().pin)
    assert np.degrees(board.offset[:8]) == pytest.approx([-180, -179, -178, -177, -176, -175, -174, -180])
    assert board.strength[[0, 255]] == pytest.approx([1, 1 - 255 / 512], abs=1e-6)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"count": "64"}, "256 transducers and 128 steps, got 64 and 128"),
        ({"offsets": "1,2,3,"}, "expected 256 finite numbers in a line, got 3"),
        ({"offsets": "nan," * 256}, "256 finite numbers"),
        ({"pins": "0," * 256}, "each of 0 to 255 once"),
        ({"factors": "2.0," * 256}, "expected 0 to 1"),
        ({"places": "(a, b, c)," * 256}, "expected numbers, got 'a'"),
        ({"factors": ""}, "seven lines of an OpenMPD board file, got 6"),
        ({"serial": "x" * 100_000}, "seven lines"),
    ],
)
def test_other_files_are_refused_in_one_line(tmp_path, changed, said):
    path = written(tmp_path / "board.pat", **changed)
    with pytest.raises(BrokenFileError, match=said) as wrong:
        load_board(path)
    assert str(wrong.value).startswith(str(path))


def test_a_missing_board_file(tmp_path):
    with pytest.raises(MissingFileError, match=r"board_N\.pat"):
        load_board(tmp_path / "board.pat")
    with pytest.raises(BrokenFileError):
        load_board(tmp_path)
