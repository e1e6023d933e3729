"""Text that people and programs wrote, JSON and TOML: whatever it holds, one line says what is wrong with it."""

import json
import os
import re
import tomllib
from typing import Any

from midair.errors import BrokenFileError, MissingFileError
from midair.files.atomic import existing_file, reason

LARGEST = 2**26
"""Bytes of the largest text file that is read whole."""

LARGEST_TOML = 2**20
"""Bytes of the largest file that is taken for something that a person wrote by hand."""

# Keys of keys, a.b.c: the time that tomllib takes, and its memory, grow with the square of their number.
_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){32}""")


def read_text(path: str | os.PathLike[str], expected: str, *, largest: int = LARGEST) -> str:
    """A text file in UTF-8.

    Parameters
    ----------
    path : str or PathLike
        The file.
    expected : str
        What to call it in a message, such as "a TOML file that describes a sensor".
    largest : int
        Bytes from which it is refused.

    Raises
    ------
    MissingFileError, BrokenFileError
        If it is not there, or is no text, or is larger than anybody writes.
    """
    try:
        file = existing_file(path, empty=True)
    except MissingFileError:
        raise MissingFileError(f"{path}: expected {expected}; it is not there") from None
    size = file.stat().st_size
    if size > largest:
        raise BrokenFileError(f"{path}: expected {expected}, got {size / 1e6:.4g} MB; is this the right file?")
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as wrong:
        said = "bytes that are no UTF-8" if isinstance(wrong, UnicodeDecodeError) else reason(wrong)
        raise BrokenFileError(f"{path}: expected {expected}, got {said}") from wrong


def read_toml(path: str | os.PathLike[str], expected: str) -> dict[str, Any]:
    """A file of TOML.

    Raises
    ------
    MissingFileError, BrokenFileError
        As `read_text`, and if it is no TOML.
    """
    text = read_text(path, expected, largest=LARGEST_TOML)
    try:
        return toml_of(text)
    except ValueError as wrong:
        raise BrokenFileError(f"{path}: expected {expected}, got: {reason(wrong)}") from wrong


def toml_of(text: str) -> dict[str, Any]:
    """What TOML says; ValueError if it is none, or brackets in brackets go deeper than anybody writes."""
    if _DEEP_KEY.search(text):
        raise ValueError("keys in keys, too deep to follow")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("values in values, too deep to follow") from None


def json_of(text: str | bytes) -> Any:
    """What JSON says; ValueError if it is none, or brackets in brackets go deeper than anybody writes."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("values in values, too deep to follow") from None
