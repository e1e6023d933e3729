"""Make values safe for a terminal, a spreadsheet and JSON; text in files can be malicious."""

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any


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
    if not isinstance(value, str) or not value.startswith(_FORMULA) or _is_number(value):
        return value
    return f"'{value}"


def without_formulas(json_text: str) -> str:
    """JSON in which no comma, semicolon or tab, where a spreadsheet may split a line, is followed by a formula."""
    return _BEFORE_FORMULA.sub(lambda found: f"{found[1]}\\u{ord(found[2]):04x}", json_text)


_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_BEFORE_FORMULA = re.compile(r"([,;\t])([=+\-@])")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows with equal keys as CSV, numbers with six digits; text that a spreadsheet would run as a formula is escaped.

    Parameters
    ----------
    rows : sequence of mapping
        At least one; the keys of the first are the column names.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _field(value) for name, value in row.items()})
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


def _field(value: Any) -> object:
    return f"{value:.6g}" if isinstance(value, float) else no_formula(value)
