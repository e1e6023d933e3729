"""The contract of every array, on one board and on two that face each other."""

import pytest
from board_simulator import OpenMpdSimulator
from tests.devices.test_contract import *  # noqa: F403

from midair_openmpd import Board, OpenMpdArray


@pytest.fixture(params=[1, pytest.param(2, marks=pytest.mark.long)])
def array(request):
    boards = [OpenMpdSimulator() for _ in range(request.param)]
    yield OpenMpdArray([board.port for board in boards], [Board.nominal()] * len(boards))
    for board in boards:
        board.settle()
        assert not board.sounds, "what a board got last must be silence"
        board.close()
