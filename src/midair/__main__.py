"""Entry point of the command line: ``midair`` or ``python -m midair``."""

import gc
import signal
import sys

from midair.blas import select_wide_kernel, use_one_thread
from midair.processes import protect_command
from midair.ram import return_large_arrays


def main() -> None:
    """Run the command line and exit with its status."""
    protect_command()
    select_wide_kernel()
    use_one_thread()
    return_large_arrays()
    # Collecting garbage while modules load takes a twelfth of the start-up time.
    gc.set_threshold(50_000)
    try:
        # Imported only now: this loads NumPy, which loads OpenBLAS with the settings above.
        from midair.cli import main as command_line

        command_line()
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.stderr.write("midair: stopped; nothing was written\n")
        sys.exit(130)
    finally:
        # At its end Python would search all objects for garbage once more.
        gc.freeze()


if __name__ == "__main__":
    main()
