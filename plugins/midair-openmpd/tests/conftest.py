"""Fixtures of midair's own tests, and a simulated board. The tests run from the root of the repository."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from tests.cli.conftest import own_state as own_state
from tests.conftest import _own_state as _own_state
from tests.conftest import _states as _states
from tests.devices.conftest import attempts as attempts


@pytest.fixture
def board():
    """A simulated board, which needs POSIX."""
    from board_simulator import OpenMpdSimulator

    one = OpenMpdSimulator()
    yield one
    one.close()
