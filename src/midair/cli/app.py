"""The command `midair`: exit status 0 when done, 1 for a failure (one line on stderr), 2 for wrong usage."""

import io
import itertools
import os
import re
import shlex
import signal
import sys
import time
import warnings
from collections.abc import Sequence
from contextlib import ExitStack, nullcontext
from functools import reduce
from pathlib import Path
from typing import Any, Literal

from cyclopts import (
    App,
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    Parameter,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

from midair.cli.commands import COMMANDS, FOLDERS, GROUPED, summary_of
from midair.cli.console import elapsed_time, err, parse_flags, verbosity, with_verbosity
from midair.cli.help_text import GROUPS, add_command
from midair.errors import InputError, MidairError, MissingFileError, UnknownDeviceError, did_you_mean
from midair.ram import address_limit
from midair.version import __version__

TRACEBACK = "MIDAIR_TRACEBACK"
"""Environment variable: if set, an unexpected error prints its traceback, as with -v."""

_UNTIL_STOPPED = ("studio", "serve", "live", "record", "study run")
"""Beginnings of commands that run until a person stops them, and print by themselves."""

_LONGEST_LINE = 2000
"""Largest number of characters of a message on the terminal."""

_EPILOGUE = """Examples:
  midair demo
  midair record virtual:towel take.h5
  midair solve take.h5
  midair play take.drive.h5

Every command takes --all (print all lines of the result), -q (hide progress bars and meters) and -v (print the run
time, and a traceback on errors). Quantities need a unit: 200mm, 20Hz, 0.5s, 30Pa.
Help on a command: midair help COMMAND."""

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
    from midair.devices import ordered_at, process_start_time, signals_end_the_program

    # From here on `midair stop` applies, even before the command registers that it plays.
    with ordered_at(process_start_time()), signals_end_the_program():
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


def run(tokens: Sequence[str]) -> int:
    """Run a command line and return its exit status."""
    how, tokens = parse_flags([*tokens[1:], "--help"] if tokens[:1] == ["help"] else tokens)
    with with_verbosity(how):
        began = time.monotonic()
        status = _status(tokens)
        if how.verbose:
            err().print(f"took {time.monotonic() - began:.2f} s")
        return status


def _names_command(tokens: Sequence[str]) -> bool:
    """Whether a line names a command; help and version need neither devices nor files."""
    return any(token in COMMANDS or token in FOLDERS for token in tokens) and tokens[-1] not in ("--help", "-h")


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
            chain = " ".join(["midair", *(wrong.command_chain or ()), "--help"])
            return _print_line(f"{_usage(wrong, tokens)} (see {chain})", 2)
        except MidairError as wrong:
            return _print_line(_message(wrong), 2 if isinstance(wrong, UnknownDeviceError) else 1)
        except KeyboardInterrupt:
            return _print_line(_kept_files(files), 130)
        except BrokenPipeError:
            return 1
        except Exception as wrong:  # noqa: BLE001  # the last resort: one line, whatever happened
            return _report_unexpected(wrong)
        return status if isinstance(status, int) else 0


def _message(wrong: MidairError) -> str:
    """The message of an error; a file of another program has to be imported before other commands read it."""
    named = str(wrong).partition(":")[0]
    if isinstance(wrong, MissingFileError):
        from midair.datasets import TOUCHES

        name, dot, ending = named.partition(".")
        if name in TOUCHES and dot + ending in ("", TOUCHES[name].ending):
            return f"{named}: no such file; midair gallery {name} writes this touch to {name}{TOUCHES[name].ending}"
    if not isinstance(wrong, InputError) or not wrong.parameters:
        return str(wrong)
    from midair.cli.import_options import TYPED

    file = shlex.quote(named) if Path(named).is_file() else "FILE"
    return wrong.message(TYPED).replace("; give ", f"; import it first, midair import {file}, and give ")


def _usage(wrong: CycloptsError, tokens: Sequence[str]) -> str:
    """The message for a command line that cannot be parsed."""
    if isinstance(wrong, MissingArgumentError) and wrong.argument is not None and wrong.command_chain:
        name = wrong.argument.name
        value = next((value for option, value in itertools.pairwise(tokens) if option == name), "")
        if value.startswith("-"):
            return f"{name}: expected a value that is not below 0, got {value}"
        named = reduce(App.__getitem__, wrong.command_chain, app)
        described = named.assemble_argument_collection(parse_docstring=True)
        about = next((each.parameter.help or "" for each in described if each.name == name), "")
        count, _ = wrong.argument.token_count()
        what = f"{count if count > 1 else 'a'} value{'s' * (count > 1)} of {name}" if name in tokens else name
        first = re.split(r"[.;] |[.;]?$|\n", about)[0]
        return f"{' '.join(wrong.command_chain)}: expected {what}: {first}"
    if isinstance(wrong, UnknownOptionError):
        word = (wrong.token.keyword or wrong.token.value).partition("=")[0]
        return f'unknown option "{word}"{_advice(word, wrong)}'
    if isinstance(wrong, UnusedCliTokensError) and wrong.unused_tokens:
        before = next((a for a, b in itertools.pairwise(tokens) if b == wrong.unused_tokens[0]), "")
        known = reduce(App.__getitem__, wrong.command_chain or (), app).assemble_argument_collection()
        options = ", ".join([each.name for each in known if each.name.startswith("--")][:3])
        advice = f"options begin with -- (such as {options}), a value with a space needs quotes"
        about = f"{before} takes no value" if before.startswith("--") else advice
        return f"unexpected: {' '.join(wrong.unused_tokens)}; {about}"
    if isinstance(wrong, UnknownCommandError) and wrong.unused_tokens and wrong.app is app:
        # The message of cyclopts imports every command.
        word = wrong.unused_tokens[0]
        return f'unknown command "{word}"{did_you_mean(word, [*COMMANDS, *FOLDERS, "--version", "--help"])}'
    said = re.sub(r"unable to convert (.*) into (float|int)\.", r"expected a number, got \1", str(wrong).strip())
    for a, b in itertools.pairwise(tokens):
        if re.fullmatch(r"[A-Za-zµ°%]{1,2}(/[A-Za-z]+)?", b):
            said = said.replace(f"got '{a}'; add the unit", f"got '{a} {b}'; write {a}{b}, without the space")
    named = getattr(wrong.argument, "name", "") if isinstance(wrong, CoercionError) else ""
    return said if not named or named in said else f"{named}: {said}"


def _advice(word: str, wrong: UnknownOptionError) -> str:
    """End of the message for an unknown option: one that is alike, or the command that has it."""
    names = [name for each in wrong.argument_collection for name in each.names]
    word = {"--length": "--duration", "--time": "--duration"}.get(word, word)
    if near := [name for name in names if name.startswith("--" + word.lstrip("-"))]:
        return f"; did you mean {' or '.join(near[:3])}?"
    if word in ("-o", "--out", "--output") and "OUTPUT" in names:
        return "; name the output after the other files, without an option"
    return did_you_mean(word, [name for name in names if name.startswith("--")]) or _elsewhere(word)


def _elsewhere(option: str) -> str:
    """The commands that have an option; those whose source, and what they share, does not declare it stay unread."""
    cli, name = Path(__file__).parent, re.escape(option.strip("-"))
    field, places = name.replace(r"\-", "_"), set[str]()
    declared = re.compile(rf'(?m)^ +{field}: |"(--)?{name}[" =]')
    for path in cli.parent.rglob("*.py"):
        text, own = path.read_text(encoding="utf-8"), path.is_relative_to(cli / "commands")
        if (path.is_relative_to(cli) or "setting(" in text) and declared.search(text):
            places.add(path.relative_to(cli).parts[1].removesuffix(".py") if own else "")
    likely = (app[name] for name in (*COMMANDS, *FOLDERS) if places & {"", COMMANDS.get(name, name)})
    described = ((each, each.assemble_argument_collection()) for each in likely if each.default_command)
    there = (each.name[0] for each, known in described if any(option in one.names for one in known))
    named = list(itertools.islice(there, 4))
    return f"; it is an option of midair {' and '.join(named)}" if 0 < len(named) < 4 else ""


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
    if issubclass(category, getattr(sys.modules.get("midair.files"), "NoLocksWarning", ())):
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
