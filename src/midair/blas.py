"""Settings of the BLAS library, which it reads only when NumPy loads it: one thread, and OpenBLAS's widest kernel.

OpenBLAS up to 0.3.31 does not list AMD's family 26 (Zen 5). Where its check of the processor's features fails too, it
uses a 256-bit kernel on a processor with 512-bit instructions (github.com/OpenMathLib/OpenBLAS, issue 6029, pull
request 6033), and complex products take twice as long.
"""

import os
import re
from collections.abc import MutableMapping
from pathlib import Path

VARIABLE = "OPENBLAS_CORETYPE"
WIDE = "SkylakeX"
NEEDED = {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
"""CPU flags of the instructions that the wide kernel uses."""


def misses_wide_kernel(cpuinfo: str) -> bool:
    """True if OpenBLAS may choose the narrow kernel on this CPU although it supports the wide one (/proc/cpuinfo)."""
    family = re.search(r"^cpu family\s*:\s*(\d+)", cpuinfo, re.MULTILINE)
    flags = re.search(r"^flags\s*:(.*)", cpuinfo, re.MULTILINE)
    if "AuthenticAMD" not in cpuinfo or family is None or flags is None:
        return False
    return int(family[1]) >= 26 and set(flags[1].split()) >= NEEDED


def select_wide_kernel(environ: MutableMapping[str, str] = os.environ, cpuinfo: Path = Path("/proc/cpuinfo")) -> bool:
    """Set OPENBLAS_CORETYPE, unless set, before NumPy loads OpenBLAS with the narrow kernel; True if it was set."""
    if VARIABLE in environ or not cpuinfo.is_file() or not misses_wide_kernel(cpuinfo.read_text(encoding="utf-8")):
        return False
    environ[VARIABLE] = WIDE
    return True


def use_one_thread(environ: MutableMapping[str, str] = os.environ) -> None:
    """Let BLAS use one thread in this process and its children, unless the user chose another number.

    The matrices of an array are so small that several threads mostly wait: on two cores a solve takes twice the time.
    """
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        environ.setdefault(name, "1")
