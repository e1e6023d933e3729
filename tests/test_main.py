import subprocess
import sys

from midair.version import __version__

MAIN = "from midair.__main__ import main\nmain()"


def called(*words):
    return subprocess.run([sys.executable, *words], capture_output=True, text=True)


def test_it_says_its_version_and_its_exit_status_is_the_command_s():
    done = called("-m", "midair", "--version")
    assert (done.stdout.strip(), done.stderr, done.returncode) == (__version__, "", 0)
    for line, status in (("no-such-command", 2), ("info no-such-file.h5", 1)):
        done = called("-m", "midair", *line.split())
        assert (done.returncode, done.stderr[:8], done.stderr.count("\n")) == (status, "midair: ", 1), done.stderr


def test_ctrl_c_while_it_is_loaded_is_no_traceback():
    for module in ("midair.cli", "midair.files", "midair.cli.commands.info"):
        interrupted = f"import sys\nclass Stop:\n    def find_spec(self, name, *_):\n        if name == {module!r}:\n"
        interrupted += "            raise KeyboardInterrupt\nsys.meta_path.insert(0, Stop())\n"
        done = called("-c", interrupted + MAIN, "info", "take.h5")
        assert (done.returncode, done.stderr) == (130, "midair: stopped; nothing was written\n"), module


def test_ctrl_c_at_exit_is_no_traceback():
    """The exit waits for the process that checks files, among others."""
    again = "import atexit, os, signal\natexit.register(lambda: os.kill(os.getpid(), signal.SIGINT))\n"
    for line, status in (("--version", 0), ("info no-such-file.h5", 1)):
        done = called("-c", again + MAIN, *line.split())
        assert (done.returncode, "Traceback" in done.stderr) == (status, False), done.stderr
