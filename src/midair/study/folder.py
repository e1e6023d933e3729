"""The folder of a study: its design as TOML, checked by pydantic, trials from CSV, plan and logs."""

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal, get_args

import tomli_w
from pydantic import ConfigDict, TypeAdapter, ValidationError

from midair.errors import BrokenFileError, InputError, MissingFileError
from midair.files import atomic_folder, json_of, read_text, toml_of
from midair.study.design import (
    Design,
    Plan,
    SessionState,
    StimulusKind,
    answers_table,
    digest_of,
    draw_plan,
    excluded_participants,
    replay,
    session_notes,
    thresholds_of,
)
from midair.study.findings import StudyData, data_of_answers

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


Template = Literal["paper", "detection", "intervals", "paired"]
"""Included designs: section 5.3 of the paper; detection threshold of a vibration; two-interval comparison of strength;
paired comparison."""


def template_text(template: Template, *, take: str | None = None) -> str:
    """TOML of an included design; `take` is the name of a recording whose threshold `detection` measures.

    Raises InputError for a take with another design.
    """
    text = files("midair.study").joinpath("templates", f"{template}.toml").read_text(encoding="utf-8")
    if not take:
        return text
    if template != "detection":
        raise InputError(f"take: expected the template detection, which measures its threshold, got {template}")
    raw, stem = toml_of(text), take.removesuffix(".h5")
    for one in raw["stimuli"]:
        if one.pop("made_from", "") or "source" in one:
            one["source"] = f"{stem}.drive.h5"
    return tomli_w.dumps(raw | {"title": f"Detection threshold of {stem} in midair"})


def read_design(
    text: str, *, name: str = "", participants: int = 0, seed: int | None = None, trials: str = ""
) -> Design:
    """Parse a design from TOML.

    `name`, `participants` and `seed` override the text if given (not empty, not 0, not None); `trials` is a CSV table
    of trials, see `add_trials`. Raises InputError if the text is no TOML or no valid design; states where.
    """
    try:
        raw: dict[str, Any] = toml_of(text)
    except ValueError as wrong:
        raise InputError(f"study: expected TOML, got: {wrong}") from wrong
    given = {"name": name, "participants": participants, "seed": seed}
    if trials:
        try:
            raw = add_trials(raw, trials)
        except (AttributeError, KeyError, TypeError) as wrong:
            raise InputError("study: expected stimuli, questions and blocks with names; correct the TOML") from wrong
    raw |= {key: value for key, value in given.items() if value or (key == "seed" and value is not None)}
    # pydantic accepts no config for a dataclass, but applies that of a tuple to the dataclasses inside.
    design = TypeAdapter(tuple[Design], config=ConfigDict(extra="forbid"))
    try:
        return design.validate_python((raw,))[0]
    except ValidationError as wrong:
        raise _input_error(wrong) from wrong


class StudyFolder:
    """A study on disk: ``plan.toml`` (the design), ``plan.json`` (the drawn plan), ``sessions/sub-NN.jsonl``."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def create(
        cls,
        path: Path,
        text: str,
        design: Design,
        *,
        drives: Callable[[Path], Mapping[str, str]] | None = None,
        trials: str = "",
    ) -> "StudyFolder":
        """Draw the plan of a new study and store it atomically with its TOML `text`, readable by this user only.

        `trials` is the CSV table from which `read_design` took stimuli and blocks; it is stored beside the plan.

        `drives` writes the drives into a folder and returns their digests by name; without it the plan has no drives.
        Raises FileError if the folder is not empty: a plan is never overwritten.
        """
        draw_plan(design)  # raises before the drives are solved, which takes long
        with atomic_folder(path) as partial:
            partial.chmod(0o700)
            plan = draw_plan(design, drives=drives(partial) if drives else None)
            content = json.dumps(asdict(plan), indent=1, ensure_ascii=False)
            table = [("trials.csv", trials)] if trials else []
            for name, written in (("plan.toml", text), ("plan.json", content), *table):
                (partial / name).touch(mode=0o600)
                (partial / name).write_text(written, encoding="utf-8")
        return cls(path)

    def plan(self) -> Plan:
        """Read the plan; raises MissingFileError, or BrokenFileError if it was changed after it was drawn."""
        file = self.path / "plan.json"
        if not file.exists():
            raise MissingFileError(
                f"{self.path}: expected a study with a plan.json; create one with `midair study new`"
            )
        try:
            content = json_of(read_text(file, "a plan"))
            found = digest_of(content["design"], content["trials"], content.get("drives"))
            plan = TypeAdapter(Plan).validate_python(content)
        except (ValueError, KeyError, AttributeError, TypeError) as wrong:
            raise BrokenFileError(f"{file.name}: expected a plan, got other content; restore a copy") from wrong
        if plan.digest != found:
            raise BrokenFileError(
                f"{file.name}: expected plan {plan.digest}, got {found}; it was changed after it was drawn"
            )
        return plan

    def log(self, participant: int) -> Path:
        """Path of the log of a participant."""
        return self.path / "sessions" / f"sub-{participant:02d}.jsonl"

    def sessions(self) -> list[SessionState]:
        """State of every session with a log."""
        plan = self.plan()
        return [self.session(plan, n) for n in range(1, plan.design.participants + 1) if self.log(n).exists()]

    def session(self, plan: Plan, participant: int) -> SessionState:
        """State of the session of one participant.

        Raises MissingFileError without a log, BrokenFileError if the log is damaged, and MismatchError if it belongs to
        another participant or study.
        """
        from midair.study.session import read_events

        log = self.log(participant)
        return replay(read_events(log), plan, participant, name=log.name)


def data_of_study(folder: StudyFolder) -> StudyData:
    """Read and sort the answers of a study for `analyse`.

    Raises BrokenFileError if the plan was changed after it was drawn or a log is damaged, MismatchError if a log
    belongs to another participant or another study, and InputError if no answer is scored.
    """
    plan, sessions = folder.plan(), folder.sessions()
    data = data_of_answers(
        answers_table(plan, sessions),
        plan.design.analysis,
        thresholds=thresholds_of(plan, sessions),
        excluded=excluded_participants(plan, sessions),
        design=plan.design,
    )
    return replace(data, notes=session_notes(plan, sessions))


def _input_error(wrong: ValidationError) -> InputError:
    """Error of the design itself, or the pydantic error with its position in the TOML."""
    first = wrong.errors()[0]
    refused = first.get("ctx", {}).get("error")
    if isinstance(refused, InputError):
        return refused
    where = ".".join(str(part) for part in first["loc"][1:])
    unknown = first["type"] == "unexpected_keyword_argument"
    message = "extra inputs are not permitted" if unknown else first["msg"][0].lower() + first["msg"][1:]
    return InputError(f"study: {where}: {message}; correct the TOML")
