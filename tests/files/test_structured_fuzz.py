"""Damaged files: a value or one line, never a traceback, a crash or a hang."""

import sys

import pytest

if sys.platform == "win32":
    pytest.skip("Windows has no processes that are copies", allow_module_level=True)


@pytest.mark.long
@pytest.mark.parametrize("count", [100, pytest.param(10_000, marks=pytest.mark.slow)])
def test_damaged_files_are_read_or_refused_in_one_line(count, tmp_path):
    pytest.importorskip("pyxdf")
    from tests.fuzzing import try_many

    found = try_many(count, 1, tmp_path)
    assert set(found) <= {"read", "refused"}, found
    assert found.total() == count
    assert found["refused"] > count / 4, "most damage is noticed"
    assert found["read"] > count / 20, "some is not, and read for what it says"
