"""Whether addresses outside can be asked at all: one line where they cannot, before hundreds of them fail."""

import sys
import urllib.request
from urllib.error import URLError

ASKED = "https://docs.python.org/3/"


def main(address: str = ASKED, *, patience: float = 10.0) -> str:
    """What is wrong with the network, in one line; empty where an address answers."""
    try:
        with urllib.request.urlopen(address, timeout=patience):
            return ""
    except (URLError, OSError, ValueError) as wrong:
        return f"links: expected a network that reaches {address}, got: {wrong}; run it where there is one"


if __name__ == "__main__":
    sys.exit(main() or 0)
