"""The command `midair`: exit status 0 when done, 1 for a failure (one line on stderr), 2 for wrong usage."""

import io
import os
import signal
import sys
import time
import warnings
from collections.abc import Sequence
from contextlib import ExitStack, nullcontext
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

from cyclopts import App, CycloptsError, Parameter, UnknownCommandError, UnusedCliTokensError

from midair.cli.commands import COMMANDS, FOLDERS, GROUPED, summary_of
from midair.cli.console import elapsed_time, err, parse_flags, verbosity, with_verbosity
from midair.cli.help_text import GROUPS, add_command
from midair.errors import MidairError, UnknownDeviceError
from midair.ram import address_limit
from midair.version import __version__

TRACEBACK = "MIDAIR_TRACEBACK"
"""Environment variable: if set, an unexpected error prints its traceback, as with -v."""

OPEN_FILES = 64
"""Smallest limit of open files with which a command starts."""

_UNTIL_STOPPED = ("studio", "serve", "live", "record", "study run")
"""Beginnings of commands that run until a person stops them, and print by themselves."""

_LONGEST_LINE = 2000
"""Largest number of characters of a message on the terminal."""

_EPILOGUE = """Examples:
  midair demo
  midair record virtual:towel take.h5
  midair solve take.h5
  midair play take.drive.h5

Every command takes -q (hide progress bars and meters) and -v (print the run time, and a traceback on errors).
Quantities need a unit: 200mm, 20Hz, 0.5s, 30Pa. Help on a command: midair COMMAND --help."""

app = App(
    name="midair",
    help="Record touch with a sensor, reproduce it in midair with focused ultrasound, and compare the result.",
    help_epilogue=_EPILOGUE,
    version=__version__,
    version_flags=("--version", "-V"),
    help_format="plaintext",
    help_on_error=False,
    default_parameter=Parameter(negative=()),
    # `run` catches Ctrl-C and prints which files were kept.
    suppress_keyboard_interrupt=False,
)


def completion_command(shell: Literal["bash", "zsh", "fish"], /) -> None:
    """Print a script that lets a shell complete commands and options with the tab key.

    Parameters
    ----------
    shell
        Shell to write the script for: bash, zsh or fish.

    Examples
    --------
    $ eval "$(midair completion bash)"
    $ midair completion fish > ~/.config/fish/completions/midair.fish
    """
    sys.stdout.write(app.generate_completion(shell=shell))


for group, listed in GROUPED.items():
    for order, name in enumerate(listed):
        placed: Any = {"group": GROUPS[group], "sort_key": order}
        app.command(f"midair.cli.commands:{name}_app", name=name, help=summary_of(name), **placed)
for name, (group, summary) in FOLDERS.items():
    app.command(f"midair.cli.commands.{name}:{name}_app", name=name, help=summary, group=GROUPS[group])
add_command(app, completion_command, "completion", group="Help")
for flag in ("--help", "--version"):
    app[flag].group = (GROUPS["Help"],)


def main(tokens: Sequence[str] | None = None) -> None:
    """Run a command line and exit with its status."""
    warnings.showwarning = _print_warning
    # Characters that the terminal's encoding lacks are escaped.
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")
    tokens = sys.argv[1:] if tokens is None else tokens
    if not _names_command(tokens):
        sys.exit(_run_to_exit(tokens))
    from midair.devices import ordered_at, process_start_time

    # Never in the way of `midair stop`.
    if "stop" not in tokens and (refused := _too_few_files()):
        sys.exit(_print_line(refused, 1))
    # From here on `midair stop` applies, even before the command registers that it plays.
    with ordered_at(process_start_time()):
        sys.exit(_run_to_exit(tokens))


def _run_to_exit(tokens: Sequence[str]) -> int:
    """Run a command line before the process exits; further Ctrl-C cannot interrupt the exit with a traceback."""
    try:
        status = run(tokens)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        status = _print_line("stopped", 130)
    return status


def _too_few_files() -> str:
    """One line if this process may open too few files at once for its connections and libraries."""
    try:
        import resource
    except ImportError:
        return ""
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if limit == resource.RLIM_INFINITY or limit >= OPEN_FILES:
        return ""
    return f"expected a limit of {OPEN_FILES} open files or more, got {limit} (ulimit -n); raise it: ulimit -n 1024"


def run(tokens: Sequence[str]) -> int:
    """Run a command line and return its exit status."""
    how, tokens = parse_flags(tokens)
    with with_verbosity(how):
        began = time.monotonic()
        status = _status(tokens)
        if how.verbose:
            err().print(f"took {time.monotonic() - began:.2f} s")
        return status


def _names_command(tokens: Sequence[str]) -> bool:
    """Whether a line names a command; help and version need neither devices nor files."""
    return any(token in COMMANDS or token in FOLDERS for token in tokens)


def _status(tokens: Sequence[str]) -> int:
    with ExitStack() as held:
        files: Sequence[Path] = ()
        if _names_command(tokens):
            from midair.files import collect_written_files

            files = held.enter_context(collect_written_files())
        try:
            begins = " ".join(tokens[:2])
            with nullcontext() if begins.startswith(_UNTIL_STOPPED) else elapsed_time(begins.partition(" ")[0]):
                status = app(list(tokens), exit_on_error=False, print_error=False, result_action="return_value")
        except CycloptsError as wrong:
            return _print_line(f"{_usage(wrong)} (see midair --help)", 2)
        except MidairError as wrong:
            return _print_line(str(wrong), 2 if isinstance(wrong, UnknownDeviceError) else 1)
        except KeyboardInterrupt:
            return _print_line(_kept_files(files), 130)
        except BrokenPipeError:
            return 1
        except Exception as wrong:  # noqa: BLE001  # the last resort: one line, whatever happened
            return _report_unexpected(wrong)
        return status if isinstance(status, int) else 0


def _usage(wrong: CycloptsError) -> str:
    """The message for a command line that cannot be parsed."""
    if isinstance(wrong, UnusedCliTokensError) and wrong.unused_tokens:
        return f"unexpected: {' '.join(wrong.unused_tokens)}; options begin with --, a value with a space needs quotes"
    if isinstance(wrong, UnknownCommandError) and wrong.unused_tokens and wrong.app is app:
        # The message of cyclopts imports every command.
        (word, *_), names = wrong.unused_tokens, [*COMMANDS, *FOLDERS]
        near = "".join(f' Did you mean "{name}"?' for name in get_close_matches(word, names, n=1))
        return f'Unknown command "{word}".{near}'
    return str(wrong).strip()


def _kept_files(files: Sequence[Path]) -> str:
    """One line that lists the files that exist after Ctrl-C."""
    here = Path.cwd()
    there = [str(file.relative_to(here) if file.is_relative_to(here) else file) for file in files if file.exists()]
    if not there:
        return "stopped; nothing was written"
    return f"stopped; kept {', '.join(there[:5])}{f' and {len(there) - 5} more' if len(there) > 5 else ''}"


def _report_unexpected(wrong: Exception) -> int:
    """Print an unexpected error in one line; with -v or `TRACEBACK`, raise it."""
    if os.environ.get(TRACEBACK) or verbosity().verbose:
        raise wrong
    if isinstance(wrong, MemoryError):
        advice = "cut the recording (midair cut) or use a computer with more memory"
        if (limit := address_limit()) is not None:
            advice = f"the limit is {limit / 1e9:.2g} GB of address space (ulimit -v), raise it"
        return _print_line(f"not enough memory; {advice}", 1)
    if isinstance(wrong, OSError) and wrong.strerror:
        where = f"{os.fspath(wrong.filename)}: " if isinstance(wrong.filename, str | bytes) else ""
        return _print_line(f"{where}{wrong.strerror} (-v shows where)", 1)
    said = f"{type(wrong).__name__}: {wrong}" if str(wrong) else type(wrong).__name__
    return _print_line(f"this is an error in midair, please report it: {said[:400]} (-v shows where)", 1)


def _print_warning(message: Warning | str, category: type[Warning], *where: Any) -> None:
    """Print a midair warning as one line, others as Python does."""
    # A warning may arrive before midair.files is imported.
    no_locks = getattr(sys.modules.get("midair.files"), "NoLocksWarning", ())
    if issubclass(category, no_locks):
        _print_line(str(message), 0)
    else:
        # Without the source line; the console escapes control characters, which texts of files may contain.
        err().print(warnings.formatwarning(message, category, *where[:2], line=""), end="")


def _print_line(message: str, status: int) -> int:
    line = " ".join(message.split())
    if len(line) > _LONGEST_LINE:  # a text of a file is quoted; keep the name before it and the advice after it
        half = _LONGEST_LINE // 2
        line = f"{line[:half]} [...] {line[-half:]}"
    err().print(f"midair: {line}")
    return status
