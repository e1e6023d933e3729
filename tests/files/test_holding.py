import os
import subprocess
import sys

import pytest

from midair.errors import DeviceStateError, FileError
from midair.files import hold

HOLDER = """
import os, sys
from midair.files import hold
hold(os.open(sys.argv[1], os.O_RDWR), "held")
print("has it", flush=True)
sys.stdin.read()
"""


def test_one_program_at_a_time_until_it_ends_however_it_ends(tmp_path):
    path = tmp_path / "log"
    path.touch()
    mine = os.open(path, os.O_RDWR)
    words = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "has it\n"
        with pytest.raises(DeviceStateError, match="end the other one first"):
            hold(mine, "log: end the other one first")
        other.kill()
    hold(mine, "log: end the other one first")
    os.close(mine)


def test_a_disk_without_locks_is_named_and_nobody_is_accused(tmp_path):
    """Whatever but "somebody has it" the system answers; here that there is no such file, elsewhere ENOLCK."""
    path = tmp_path / "log"
    path.touch()
    mine = os.open(path, os.O_RDWR)
    os.close(mine)
    with pytest.raises(FileError, match="log: expected a disk that can keep a second program out, got: Bad file"):
        hold(mine, "log: end the other one first")
