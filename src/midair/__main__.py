"""Entry point of the command line: ``midair`` or ``python -m midair``."""

import gc
import signal
import sys

from midair.blas import select_wide_kernel
from midair.processes import protect_command
from midair.ram import return_large_arrays


def main() -> None:
    """Run the command line and exit with its status."""
    protect_command()
    select_wide_kernel()
    return_large_arrays()
    # Imported modules stay in memory: collecting garbage while they load takes a twelfth of the start-up time.
    gc.disable()
    try:
        # Imported only now: this loads NumPy, and OpenBLAS chooses its kernel when NumPy loads it.
        from midair.cli import load
        from midair.cli import main as command_line

        load(sys.argv[1:])
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.stderr.write("midair: stopped; nothing was written\n")
        sys.exit(130)
    gc.freeze()
    gc.enable()
    command_line()


if __name__ == "__main__":
    main()
