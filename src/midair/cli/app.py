"""The command `midair`: one line for an error, 0 when done, 1 when the work failed, 2 for wrong usage."""

import io
import os
import sys
import time
import warnings
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from cyclopts import App, CycloptsError, Parameter

from midair.cli.commands import COMMANDS, FOLDERS, PASSES, command_of
from midair.cli.terminal import GROUPS, busy_bar, err, flags_of, offer, verbosity, with_verbosity
from midair.errors import MidairError, UnknownDeviceError
from midair.version import __version__

TRACEBACK = "MIDAIR_TRACEBACK"
"""Environment variable: set to anything, an error that nobody foresaw comes with its traceback, as with -v."""

_EPILOGUE = """Examples:
  midair demo
  midair record virtual:towel take.h5
  midair solve take.h5
  midair play take.drive.h5

Anywhere in a line: -q shows no bars and meters; -v says more, also where an error came from.
Quantities take units: 200mm, 20Hz, 0.5s, 30Pa. Every command explains itself with --help."""

app = App(
    name="midair",
    help="A tape recorder for touch: record what an object does to skin, play it back in midair, check what came back.",
    help_epilogue=_EPILOGUE,
    version=__version__,
    version_flags=("--version", "-V"),
    help_format="plaintext",
    help_on_error=False,
    default_parameter=Parameter(negative=()),
    # What was kept is said here, and not nothing there.
    suppress_keyboard_interrupt=False,
)


def completion_command(shell: Literal["bash", "zsh", "fish"], /) -> None:
    """Print what makes a shell complete commands and options at the tab key.

    Parameters
    ----------
    shell
        bash, zsh or fish.

    Examples
    --------
    $ eval "$(midair completion bash)"
    $ midair completion fish > ~/.config/fish/completions/midair.fish
    """
    sys.stdout.write(app.generate_completion(shell=shell))


for order, (name, (group, _, said)) in enumerate(COMMANDS.items()):
    app.command(f"midair.cli.commands:{name}_app", name=name, help=said, group=GROUPS[group], sort_key=order)
for name, (group, said) in FOLDERS.items():
    app.command(f"midair.cli.commands.{name}:{name}_app", name=name, help=said, group=GROUPS[group])
offer(app, completion_command, "completion", group="Help")
for flag in ("--help", "--version"):
    app[flag].group = (GROUPS["Help"],)


def load(tokens: Sequence[str]) -> None:
    """Import the command that a line names, and what every command takes; nothing for help and version."""
    name = next((token for token in tokens if token in COMMANDS or token in FOLDERS), None)
    if name is not None:
        # What is wrong with it is said when it runs.
        with suppress(Exception):
            for room in ("midair.devices", "midair.files"):
                import_module(room)
            app[name]


def main(tokens: Sequence[str] | None = None) -> None:
    """Run a command line and leave with its exit status."""
    warnings.showwarning = _say_warning
    # A name that the terminal cannot spell is printed all the same.
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    tokens = sys.argv[1:] if tokens is None else tokens
    if not _works(tokens):
        sys.exit(run(tokens))
    from midair.devices import ordered_at, process_began

    # From here on a stop counts, also one that comes before the command says that it plays.
    with ordered_at(process_began()):
        sys.exit(run(tokens))


def run(tokens: Sequence[str]) -> int:
    """Run a command line; its exit status."""
    how, tokens = flags_of(tokens)
    with with_verbosity(how):
        began = time.monotonic()
        status = _status(tokens)
        if how.verbose:
            err().print(f"took {time.monotonic() - began:.2f} s")
        return status


def _works(tokens: Sequence[str]) -> bool:
    """Whether a line names a command, which may have devices and files: help and version need nothing of either."""
    return any(token in COMMANDS or token in FOLDERS for token in tokens)


def _status(tokens: Sequence[str]) -> int:
    if not _works(tokens):
        return _status_of(tokens, ())
    from midair.files import files_noted

    with files_noted() as files:
        return _status_of(tokens, files)


def _status_of(tokens: Sequence[str], files: Sequence[Path]) -> int:
    try:
        name = command_of(tokens)
        with busy_bar(name, PASSES[name]) if name else nullcontext():
            status = app(list(tokens), exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as wrong:
        return _say(f"{str(wrong).strip()} (see midair --help)", 2)
    except UnknownDeviceError as wrong:
        return _say(str(wrong), 2)
    except MidairError as wrong:
        return _say(str(wrong), 1)
    except KeyboardInterrupt:
        return _say(_kept(files), 130)
    except BrokenPipeError:
        return 1
    except Exception as wrong:  # noqa: BLE001  # the last resort: one line, whatever happened
        return _unforeseen(wrong)
    return status if isinstance(status, int) else 0


def _kept(files: Sequence[Path]) -> str:
    """What Ctrl-C leaves, in one line."""
    here = Path.cwd()
    there = [str(file.relative_to(here) if file.is_relative_to(here) else file) for file in files if file.exists()]
    if not there:
        return "stopped; nothing was written"
    return f"stopped; kept {', '.join(there[:5])}{f' and {len(there) - 5} more' if len(there) > 5 else ''}"


def _unforeseen(wrong: Exception) -> int:
    """Say in one line what nobody foresaw: people see what failed, not our code."""
    if os.environ.get(TRACEBACK) or verbosity().verbose:
        raise wrong
    if isinstance(wrong, MemoryError):
        return _say("there is not enough memory for this; cut the recording (midair cut) or take a larger computer", 1)
    if isinstance(wrong, OSError) and wrong.strerror:
        where = f"{os.fspath(wrong.filename)}: " if isinstance(wrong.filename, str | bytes) else ""
        return _say(f"{where}{wrong.strerror} (-v shows where)", 1)
    said = f"{type(wrong).__name__}: {wrong}" if str(wrong) else type(wrong).__name__
    return _say(f"this is an error in midair, please report it: {said[:400]} (-v shows where)", 1)


def _say_warning(message: Warning | str, category: type[Warning], *where: Any) -> None:
    """A warning of midair in its own words, without the line of code that gave it; others as Python shows them."""
    # It may come while files are imported, and from elsewhere before they are.
    no_locks = getattr(sys.modules.get("midair.files"), "NoLocksWarning", ())
    if issubclass(category, no_locks):
        _say(str(message), 0)
    else:
        sys.stderr.write(warnings.formatwarning(message, category, *where[:2]))


def _say(message: str, status: int) -> int:
    line = " ".join(message.split())
    err().print(f"midair: {line}")
    return status
