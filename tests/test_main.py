import subprocess
import sys

import pytest

from midair.version import __version__

LONG = pytest.mark.long


def called(*arguments):
    return subprocess.run([sys.executable, "-m", "midair", *arguments], capture_output=True, text=True)


def test_it_says_its_version():
    done = called("--version")
    assert (done.stdout.strip(), done.stderr, done.returncode) == (__version__, "", 0)


@pytest.mark.parametrize(
    ("arguments", "status"), [(["no-such-command"], 2), pytest.param(["info", "no-such-file.h5"], 1, marks=LONG)]
)
def test_its_exit_status_is_the_command_s(arguments, status):
    done = called(*arguments)
    assert done.returncode == status
    assert done.stderr.startswith("midair: ")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "module", ["midair.cli", *(pytest.param(one, marks=LONG) for one in ("midair.files", "midair.cli.commands.info"))]
)
def test_ctrl_c_while_it_is_loaded_is_no_traceback(module):
    interrupted = f"import sys\nclass Stop:\n    def find_spec(self, name, *_):\n        if name == {module!r}:\n"
    interrupted += "            raise KeyboardInterrupt\nsys.meta_path.insert(0, Stop())\n"
    script = interrupted + "from midair.__main__ import main\nmain()"
    done = subprocess.run([sys.executable, "-c", script, "info", "take.h5"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "midair: stopped; nothing was written\n")


@pytest.mark.parametrize(
    ("words", "status"), [(["--version"], 0), pytest.param(["info", "no-such-file.h5"], 1, marks=LONG)]
)
def test_ctrl_c_at_exit_is_no_traceback(words, status):
    """The exit waits for the process that checks files, among others."""
    again = "import atexit, os, signal\natexit.register(lambda: os.kill(os.getpid(), signal.SIGINT))\n"
    script = again + "from midair.__main__ import main\nmain()"
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True)
    assert done.returncode == status
    assert "Traceback" not in done.stderr
