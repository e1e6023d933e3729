"""The wide kernel is selected where OpenBLAS would miss it, before NumPy is loaded; a value set by the user stays."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from midair.blas import misses_wide_kernel, select_wide_kernel

WIDE = "fpu sse avx2 avx512f avx512dq avx512cd avx512bw avx512vl avx512_bf16"


def cpuinfo(vendor="AuthenticAMD", family=26, flags=WIDE):
    return f"processor\t: 0\nvendor_id\t: {vendor}\ncpu family\t: {family}\nmodel\t\t: 2\nflags\t\t: {flags}\n\n" * 2


@pytest.mark.parametrize(
    ("said", "missed"),
    [
        (cpuinfo(), True),
        (cpuinfo(family=25), False),  # Zen 3 and 4, which OpenBLAS knows
        (cpuinfo(vendor="GenuineIntel", family=6), False),
        (cpuinfo(flags="fpu sse avx2"), False),
        ("CPU implementer\t: 0x41\nFeatures\t: fp asimd\n", False),  # Arm has neither family nor flags
        ("", False),
    ],
)
def test_only_unlisted_processors_miss_the_wide_kernel(said, missed):
    assert misses_wide_kernel(said) is missed


def test_a_value_set_by_the_user_stays(tmp_path):
    told = tmp_path / "cpuinfo"
    told.write_text(cpuinfo())
    mine, nobody_s = {"OPENBLAS_CORETYPE": "Zen"}, {}
    assert not select_wide_kernel(mine, told)
    assert mine == {"OPENBLAS_CORETYPE": "Zen"}
    assert select_wide_kernel(nobody_s, told)
    assert nobody_s == {"OPENBLAS_CORETYPE": "SkylakeX"}
    assert not select_wide_kernel({}, tmp_path / "no such file")


@pytest.mark.long
def test_the_command_line_sets_it_before_numpy_is_loaded():
    code = (
        "import sys, midair.__main__ as start; "
        "start.select_wide_kernel = lambda: print('numpy' in sys.modules); "
        "sys.argv = ['midair', '--version']; start.main()"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[0] == "False"


@pytest.mark.skipif(
    not Path("/proc/cpuinfo").is_file() or not misses_wide_kernel(Path("/proc/cpuinfo").read_text()),
    reason="OpenBLAS knows this processor",
)
def test_doctor_reports_the_kernel_and_advice():
    environ = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    code = "from midair.rig.doctor.checkup import _kernel; import numpy; print(_kernel())"
    narrow = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environ)
    wide = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=environ | {"OPENBLAS_CORETYPE": "SkylakeX"},
    )
    # No advice for an OpenBLAS that lists the processor; otherwise the variable to set.
    assert "OPENBLAS_CORETYPE=SkylakeX" in narrow.stdout or "state='ok'" in narrow.stdout
    assert "state='ok'" in wide.stdout
    assert "SkylakeX" in wide.stdout
