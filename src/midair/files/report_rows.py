"""Tables as CSV text, and values that JSON can represent."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

from midair.files.sanitise_text import no_formula


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
