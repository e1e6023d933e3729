import numpy as np
import pytest

from midair.errors import BrokenFileError, InputError, MissingFileError, ShapeError
from midair_openmpd import Board, array_of_boards, load_board


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


def test_places_and_pins_are_those_of_the_makers_files():
    """Single figures of OpenMPD_Client/board_1.pat, read by eye."""
    board = Board.nominal()
    assert board.position[0] == pytest.approx([-0.07875, 0.07875, 0])
    assert board.position[1] == pytest.approx([-0.07875, 0.06825, 0])
    assert board.position[16] == pytest.approx([-0.06825, 0.07875, 0])
    assert board.position[255] == pytest.approx([0.07875, -0.07875, 0])
    assert board.pin[:16].tolist() == [249, 253, 241, 245, 233, 237, 225, 229, 217, 221, 209, 213, 201, 205, 193, 197]
    assert board.pin[32:36].tolist() == [251, 254, 243, 246]
    assert board.pin[48:52].tolist() == [250, 255, 242, 247]
    assert board.pin[64:66].tolist() == [185, 189]
    assert board.pin[222:224].tolist() == [0, 4]
    assert board.pin[252:].tolist() == [10, 15, 2, 7]


def test_one_board_radiates_up_and_a_second_one_faces_it():
    one, twin = array_of_boards(Board.nominal()), array_of_boards(Board.nominal(), Board.nominal())
    assert (one.count, twin.count, one.name, twin.name) == (256, 512, "OpenMPD", "OpenMPD twin")
    assert np.unique(one.normal, axis=0).tolist() == [[0, 0, 1]]
    assert twin.position[:256] == pytest.approx(one.position)
    assert twin.position[256] == pytest.approx([0.07875, 0.07875, 0.2388])
    assert np.unique(twin.normal[256:], axis=0).tolist() == [[0, 0, -1]]
    assert np.bincount(twin.unit).tolist() == [256, 256]


def test_its_transducers_are_taken_for_the_loudest_that_is_published():
    assert array_of_boards(Board.nominal()).pressure == 8.02


def test_what_no_board_can_be_is_refused():
    board = Board.nominal()
    parts = {"position": board.position, "pin": board.pin, "offset": board.offset, "strength": board.strength}
    with pytest.raises(InputError, match="each of 0 to 255 once"):
        Board(**parts | {"pin": np.zeros(256, int)})
    with pytest.raises(InputError, match=r"expected 0 to 1, got 1\.5 to 1\.5"):
        Board(**parts | {"strength": np.full(256, 1.5)})
    with pytest.raises(ShapeError, match="board offset"):
        Board(**parts | {"offset": np.zeros(255)})
    with pytest.raises(InputError, match="got 3"):
        array_of_boards(board, board, board)
