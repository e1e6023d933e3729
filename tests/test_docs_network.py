"""`make links` says in one line where there is no network."""

import runpy
import socket
from pathlib import Path

SCRIPT = Path(__file__).parents[1] / "docs" / "network.py"


def test_no_network_is_one_line_that_says_what_to_do():
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{nobody.getsockname()[1]}/"
        said = runpy.run_path(str(SCRIPT))["main"](address, patience=2.0)
    assert said.startswith(f"links: expected a network that reaches {address}, got: ")
    assert said.endswith("; run it where there is one")
    assert "\n" not in said
