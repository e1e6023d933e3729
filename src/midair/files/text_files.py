"""Read text, JSON and TOML files, with an error in one line for any invalid content."""

import json
import os
import re
import tomllib
from typing import Any

from midair.errors import BrokenFileError, MissingFileError
from midair.files.atomic import existing_file, reason

LARGEST = 2**26
"""Largest text file that is read, in bytes."""

LARGEST_TOML = 2**20
"""Largest TOML file that is read, in bytes; they are written by hand."""

# Dotted keys, a.b.c: the time and memory of tomllib grow with the square of their depth.
_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")


def read_text(path: str | os.PathLike[str], expected: str, *, largest: int = LARGEST) -> str:
    """Read a text file in UTF-8.

    Parameters
    ----------
    path : str or PathLike
        The file.
    expected : str
        Description for messages, such as "a TOML file that describes a sensor".
    largest : int
        Maximum size in bytes.

    Raises
    ------
    MissingFileError, BrokenFileError
        If it does not exist, is not text, or is too large.
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
    """Read a TOML file.

    Raises MissingFileError or BrokenFileError as `read_text`, and if it is not valid TOML.
    """
    text = read_text(path, expected, largest=LARGEST_TOML)
    try:
        return toml_of(text)
    except ValueError as wrong:
        raise BrokenFileError(f"{path}: expected {expected}, got: {reason(wrong)}") from wrong


def toml_of(text: str) -> dict[str, Any]:
    """Parse TOML; raises ValueError if it is invalid or nested too deeply."""
    if _DEEP_KEY.search(text):
        raise ValueError("dotted keys that are nested too deeply")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("values that are nested too deeply") from None


def json_of(text: str | bytes) -> Any:
    """Parse JSON; raises ValueError if it is invalid or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("values that are nested too deeply") from None
