"""Read text, JSON and TOML files, and make text safe for a terminal, a spreadsheet and JSON: it can be malicious."""

import csv
import io
import json
import math
import os
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from midair.errors import BrokenFileError, MissingFileError
from midair.files.atomic import existing_file, reason
from midair.validation import is_number


def printable(text: str) -> str:
    """Escape control and invisible characters except line ends and tabs; untrusted text could control a terminal."""
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() or letter in "\n\t" else letter.encode("unicode_escape").decode()
        for letter in text
    )


def no_formula(value: object) -> object:
    """Put an apostrophe before text that a spreadsheet would run as a formula; numbers are unchanged, also as text."""
    if not isinstance(value, str) or not value.startswith(_FORMULA) or is_number(value):
        return value
    return f"'{value}"


_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows with equal keys as CSV, numbers with six digits; text that a spreadsheet would run as a formula is escaped.

    There is at least one row; the keys of the first are the column names.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow(
            {name: f"{each:.6g}" if isinstance(each, float) else no_formula(each) for name, each in row.items()}
        )
    return text.getvalue()


def for_json(value: Any) -> Any:
    """Replace NaN and infinity by None, at every depth, because JSON does not support them."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): for_json(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [for_json(each) for each in value]
    return value


LARGEST = 2**26
"""Largest text file that is read, in bytes."""

LARGEST_TOML = 2**20
"""Largest TOML file that is read, in bytes; they are written by hand."""

# Dotted keys, a.b.c: the time and memory of tomllib grow with the square of their depth.
_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")


def read_text(path: str | os.PathLike[str], expected: str, *, largest: int = LARGEST) -> str:
    """Read a text file in UTF-8 of at most `largest` bytes.

    `expected` describes it in messages, such as "a TOML file that describes a sensor". Raises MissingFileError or
    BrokenFileError if the file does not exist, is not text, or is too large.
    """
    try:
        file = existing_file(path, empty=True)
    except MissingFileError:
        raise MissingFileError(f"{path}: expected {expected}, found no file") from None
    size = file.stat().st_size
    if size > largest:
        raise BrokenFileError(f"{path}: expected {expected}, got a file of {size / 1e6:.4g} MB; check the name")
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as wrong:
        found = "bytes that are not UTF-8" if isinstance(wrong, UnicodeDecodeError) else reason(wrong)
        raise BrokenFileError(f"{path}: expected {expected}, got {found}") from wrong


def read_toml(path: str | os.PathLike[str], expected: str) -> dict[str, Any]:
    """Read a TOML file; raises the errors of `read_text`, and BrokenFileError if it is not valid TOML."""
    text = read_text(path, expected, largest=LARGEST_TOML)
    try:
        return toml_of(text)
    except ValueError as wrong:
        raise BrokenFileError(f"{path}: expected {expected}, got: {reason(wrong)}") from wrong


def toml_of(text: str) -> dict[str, Any]:
    """Parse TOML; raises ValueError if it is invalid or nested too deeply."""
    if _DEEP_KEY.search(text):
        raise ValueError("dotted keys that are nested too deeply")
    return _shallow(tomllib.loads, text)


def json_of(text: str | bytes) -> Any:
    """Parse JSON; raises ValueError if it is invalid or nested too deeply."""
    return _shallow(json.loads, text)


def _shallow(parse: Callable[[Any], Any], text: str | bytes) -> Any:
    try:
        return parse(text)
    except RecursionError:
        raise ValueError("values that are nested too deeply") from None
