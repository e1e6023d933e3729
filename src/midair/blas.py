"""Which kernel OpenBLAS takes for its products, and the wider one that it misses on some processors.

OpenBLAS up to 0.3.31 does not list AMD's family 26 (Zen 5): where its look at the processor's features fails too, it
takes a kernel of 256 bits on a processor that has 512 (github.com/OpenMathLib/OpenBLAS, issue 6029, pull request 6033),
and complex products take twice as long. It reads OPENBLAS_CORETYPE when NumPy loads it, and never again.
"""

import os
import re
from collections.abc import MutableMapping
from pathlib import Path

VARIABLE = "OPENBLAS_CORETYPE"
WIDE = "SkylakeX"
NEEDED = {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
"""What the wide kernel is made of."""


def misses_wide_kernel(cpuinfo: str) -> bool:
    """Whether OpenBLAS may take the narrow kernel on a processor that has the wide one's instructions.

    Parameters
    ----------
    cpuinfo : str
        As Linux tells it in /proc/cpuinfo.
    """
    family = re.search(r"^cpu family\s*:\s*(\d+)", cpuinfo, re.MULTILINE)
    flags = re.search(r"^flags\s*:(.*)", cpuinfo, re.MULTILINE)
    if "AuthenticAMD" not in cpuinfo or family is None or flags is None:
        return False
    return int(family[1]) >= 26 and set(flags[1].split()) >= NEEDED


def take_wide_kernel(environ: MutableMapping[str, str] = os.environ, cpuinfo: Path = Path("/proc/cpuinfo")) -> bool:
    """Ask for the wide kernel where OpenBLAS would miss it; whether it was asked for.

    Only before NumPy is loaded, in this process and in those that it starts; what a person has set stays.
    """
    if VARIABLE in environ or not cpuinfo.is_file() or not misses_wide_kernel(cpuinfo.read_text(encoding="utf-8")):
        return False
    environ[VARIABLE] = WIDE
    return True
