"""Rows of a report for programs: CSV text, and values that JSON can hold."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from midair.files.sanitise_text import no_formula


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows that share their names as comma-separated values, numbers to six digits, and no text is a formula.

    Parameters
    ----------
    rows : sequence of mapping
        At least one; the first one's names head the columns.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _field(value) for name, value in row.items()})
    return text.getvalue()


def for_json(value: Any) -> Any:
    """The same with None for NaN and infinity, which JSON lacks, at every depth."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): for_json(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [for_json(each) for each in value]
    return value


def _field(value: Any) -> object:
    return f"{value:.6g}" if isinstance(value, float) else no_formula(value)
