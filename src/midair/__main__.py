"""The command line, as ``midair`` and as ``python -m midair`` where the script is not on the path."""

import gc
import sys

from midair.blas import take_wide_kernel
from midair.ram import give_back_large


def main() -> None:
    """Run the command line and leave with its exit status."""
    take_wide_kernel()
    give_back_large()
    # What is loaded stays: looking through it for garbage at every step takes a twelfth of the time.
    gc.disable()
    try:
        # Only now: it loads NumPy, and NumPy's OpenBLAS chooses its kernel when it is loaded.
        from midair.cli import load
        from midair.cli import main as command_line

        load(sys.argv[1:])
    except KeyboardInterrupt:
        sys.stderr.write("midair: stopped; nothing was written\n")
        sys.exit(130)
    gc.freeze()
    gc.enable()
    command_line()


if __name__ == "__main__":
    main()
