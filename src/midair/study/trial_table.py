"""Stimuli and blocks of a design from a CSV table with one row per trial."""

import csv
from collections.abc import Mapping, Sequence
from typing import Any, get_args

from midair.errors import InputError
from midair.study.design import StimulusKind

SETTINGS = ("kind", "source", "made_from", "share", "code", "duration_s")
"""Columns that are settings of the stimulus; all further ones but `stimulus` and `block` are factors."""


def add_trials(raw: Mapping[str, Any], text: str, *, name: str = "trials") -> dict[str, Any]:
    """Add the stimuli and blocks of a CSV table to the content `raw` of a design's TOML.

    The table has a header and is separated by commas, semicolons or tabs: `stimulus`, and optionally `block`, settings
    of the stimulus (`SETTINGS`), and factors. Empty fields are not set. A block of a name in the table gets its
    stimuli; other blocks are created and ask all questions but those of the form. `name` is that of the table in
    messages. Raises InputError if the table is invalid; states row and column.
    """
    stimuli: dict[str, dict[str, Any]] = {one["name"]: dict(one) for one in raw.get("stimuli", [])}
    stated, first = set(stimuli), dict[str, tuple[int, dict[str, str]]]()
    order: dict[str, list[str]] = {}
    for number, row in _rows(text, name):
        stimulus = row.pop("stimulus")
        order.setdefault(row.pop("block", "") or "trials", []).append(stimulus)
        if stimulus in stated:
            if clash := next((column for column, field in row.items() if field), ""):
                raise _wrong(name, number, clash, "an empty field, since the TOML states this stimulus", row[clash])
        elif stimulus in first:
            begin, before = first[stimulus]
            if clash := next((column for column in row if row[column] != before[column]), ""):
                expected = f"{before[clash]!r} as in row {begin}, which has the same stimulus"
                raise _wrong(name, number, clash, expected, row[clash])
        else:
            first[stimulus] = (number, row)
            stimuli[stimulus] = _stimulus(stimulus, row, name, number)
    blocks: list[dict[str, Any]] = [dict(block) for block in raw.get("blocks", [])]
    asked = [one["name"] for one in raw.get("questions", []) if one["name"] not in raw.get("form", [])]
    for block, names in order.items():
        found = next((one for one in blocks if one.get("name") == block), None)
        if found is None:
            blocks.append({"name": block, "stimuli": names, "questions": asked})
        elif found.get("stimuli"):
            raise InputError(f"{name}: expected block {block!r} without stimuli in the TOML, since the table has them")
        else:
            found["stimuli"] = names
    return {**raw, "stimuli": list(stimuli.values()), "blocks": blocks}


def _rows(text: str, name: str) -> list[tuple[int, dict[str, str]]]:
    """Rows with their line numbers, fields without outer spaces."""
    lines = text.removeprefix("\ufeff").splitlines()
    head = lines[0] if lines else ""
    try:
        reader = csv.reader(lines, delimiter=max(",;\t", key=head.count), strict=True)
        filled = [(reader.line_num, [field.strip() for field in row]) for row in reader if any(row)]
    except csv.Error as wrong:
        raise InputError(f"{name}: expected a table, got: {wrong}") from wrong
    header, rows = filled[0][1] if filled else [], filled[1:]
    if "stimulus" not in header or len(set(header)) < len(header) or not all(header) or not rows:
        raise InputError(
            f"{name}: expected a header of different names with the column stimulus, and rows, got {header} and"
            f" {len(rows)} rows"
        )
    for number, row in rows:
        if len(row) != len(header):
            raise InputError(f"{name}: row {number}: expected {len(header)} fields, got {len(row)}")
        if not row[header.index("stimulus")]:
            raise _wrong(name, number, "stimulus", "the name of a stimulus", "")
    return [(number, dict(zip(header, row, strict=True))) for number, row in rows]


def _stimulus(stimulus: str, row: Mapping[str, str], name: str, number: int) -> dict[str, Any]:
    """Content of a stimulus from its first row."""
    settings: dict[str, Any] = {column: row[column] for column in SETTINGS if row.get(column)}
    kinds: Sequence[str] = [kind for kind in get_args(StimulusKind) if kind != "pair"]
    kind = settings.get("kind", "drive")
    if kind not in kinds:
        raise _wrong(name, number, "kind", f"one of {', '.join(kinds)}", kind)
    if kind != "silence" and "source" not in settings:
        raise _wrong(name, number, "source", f"the source of the {kind}", "")
    for column, read, expected in (
        ("share", float, "a number"),
        ("duration_s", float, "a number"),
        ("code", int, "a whole number"),
    ):
        if column in settings:
            try:
                settings[column] = read(settings[column])
            except ValueError as wrong:
                raise _wrong(name, number, column, expected, settings[column]) from wrong
    levels = {column: field for column, field in row.items() if column not in SETTINGS and field}
    return {"name": stimulus, **settings, "levels": levels}


def _wrong(name: str, number: int, column: str, expected: str, got: str) -> InputError:
    return InputError(f"{name}: row {number}, column {column}: expected {expected}, got {got!r}")
