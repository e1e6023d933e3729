"""Threads and kernel of BLAS are selected before NumPy is loaded; a value set by the user stays."""

import subprocess
import sys

import pytest

from midair.blas import misses_wide_kernel, select_wide_kernel, use_one_thread

WIDE = "fpu sse avx2 avx512f avx512dq avx512cd avx512bw avx512vl avx512_bf16"


def cpuinfo(vendor="AuthenticAMD", family=26, flags=WIDE):
    return f"processor\t: 0\nvendor_id\t: {vendor}\ncpu family\t: {family}\nmodel\t\t: 2\nflags\t\t: {flags}\n\n" * 2


def test_only_unlisted_processors_miss_the_wide_kernel():
    for said, missed in [
        (cpuinfo(), True),
        (cpuinfo(family=25), False),  # Zen 3 and 4, which OpenBLAS knows
        (cpuinfo(vendor="GenuineIntel", family=6), False),
        (cpuinfo(flags="fpu sse avx2"), False),
        ("CPU implementer\t: 0x41\nFeatures\t: fp asimd\n", False),  # Arm has neither family nor flags
        ("", False),
    ]:
        assert misses_wide_kernel(said) is missed, said


def test_a_value_set_by_the_user_stays(tmp_path):
    told = tmp_path / "cpuinfo"
    told.write_text(cpuinfo())
    mine, nobody_s = {"OPENBLAS_CORETYPE": "Zen"}, {}
    assert not select_wide_kernel(mine, told)
    assert mine == {"OPENBLAS_CORETYPE": "Zen"}
    assert select_wide_kernel(nobody_s, told)
    assert nobody_s == {"OPENBLAS_CORETYPE": "SkylakeX"}
    assert not select_wide_kernel({}, tmp_path / "no such file")
    one, two = {}, {"OPENBLAS_NUM_THREADS": "2"}
    for environ, threads in ((one, "1"), (two, "2")):
        use_one_thread(environ)
        assert environ["OPENBLAS_NUM_THREADS"] == threads


@pytest.mark.long
def test_the_command_line_sets_it_before_numpy_is_loaded():
    code = (
        "import sys, midair.__main__ as start; "
        "start.use_one_thread = lambda: print('numpy' in sys.modules); "
        "sys.argv = ['midair', '--version']; start.main()"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[0] == "False"
