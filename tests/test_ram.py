import subprocess
import sys

import pytest

from midair.ram import available_memory


def test_the_available_memory_of_which_a_container_may_have_less(tmp_path):
    meminfo = tmp_path / "meminfo"
    meminfo.write_text("MemTotal:       24684100 kB\nMemFree:          100000 kB\nMemAvailable:    2000000 kB\n")
    assert available_memory(meminfo, tmp_path / "none") == 2000000 * 1024
    (tmp_path / "memory.current").write_text("600000000\n")
    (tmp_path / "memory.stat").write_text("anon 550000000\ninactive_file 50000000\nactive_file 7\n")
    for limit, left in (("1000000000", 450_000_000), ("max", 2000000 * 1024)):
        (tmp_path / "memory.max").write_text(f"{limit}\n")
        assert available_memory(meminfo, tmp_path) == left


HELD = """
import sys
import numpy as np
from pathlib import Path
from midair.ram import return_large_arrays

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

told = sys.argv[1] == "told" and return_large_arrays()
# Freed once, a large array raises the size from which on the GNU library gives one back.
first = np.ones(3_000_000)
del first
before, kept = resident(), []
for _ in range(20):
    large = np.ones(1_000_000)
    kept.append(bytearray(50_000))
    del large
print(told, resident() - before)
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="only the GNU library has the choice")
def test_large_arrays_go_back_to_the_system():
    told = subprocess.run([sys.executable, "-c", HELD, "told"], capture_output=True, text=True, check=True).stdout
    said, grown = told.split()
    assert said == "True"
    assert int(grown) < 4e6
