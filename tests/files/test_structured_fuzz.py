"""Damage that follows the structure of files: a value or one line, never a traceback, a crash or a hang."""

import sys

import pytest

if sys.platform == "win32":
    pytest.skip("Windows has no processes that are copies", allow_module_level=True)

pytest.importorskip("distributed")
pytest.importorskip("pyxdf")

from tests.fuzzing.trials import TARGETS, told, try_many


def check(count, seed, folder):
    found = try_many(count, seed, folder)
    assert found.count == count
    assert not found.bad, "\n".join(told(found, 0))
    assert found.refused > found.count / 4, "most damage is noticed"
    assert found.read > found.count / 20, "some is not, and read for what it says"


@pytest.mark.long
def test_survives_damage_that_knows_the_structure(tmp_path):
    check(2 * len(TARGETS), 1, tmp_path)


@pytest.mark.slow
def test_survives_much_damage_that_knows_the_structure(tmp_path):
    check(10_000, 2, tmp_path)
