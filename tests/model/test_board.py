import numpy as np
import pytest

from midair.errors import InputError, ShapeError
from midair.model import Board, array_of_boards


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
    assert repr(board) == "<Board any, 256 transducers, no offsets>"
