"""The command line as ``python -m midair``, where the script ``midair`` is not on the path."""

from midair.cli import main

main()
