"""``python -m tests.regression``: see there."""

import os
import sys

KERNEL = "Haswell"
"""Kernel of OpenBLAS if the environment names none: every x86 processor with AVX2 can run it."""

ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
    "COLUMNS": "200",
    "TZ": "UTC",
}


def main() -> int:
    """Start again with the environment that the figures depend on, then record."""
    wanted = {"OPENBLAS_CORETYPE": os.environ.get("OPENBLAS_CORETYPE", KERNEL), **ENVIRONMENT}
    if any(os.environ.get(name) != value for name, value in wanted.items()):
        os.execve(sys.executable, [sys.executable, "-m", "tests.regression", *sys.argv[1:]], os.environ | wanted)
    from tests.regression.recorder import command_line

    return command_line()


if __name__ == "__main__":
    sys.exit(main())
