"""The folder of a study: its design as TOML, checked by pydantic, plan and logs."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import tomli_w
from pydantic import ConfigDict, TypeAdapter, ValidationError

from midair.errors import BrokenFileError, InputError, MissingFileError
from midair.files import atomic_folder, json_of, read_text, toml_of
from midair.study.design.adaptive_block import thresholds_of
from midair.study.design.plan import Plan, digest_of, draw_plan
from midair.study.design.session_state import SessionState, answers_table, excluded_participants, replay, session_notes
from midair.study.design.study_design import Design
from midair.study.findings.study_data import StudyData, data_of_answers

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


def read_design(text: str, *, name: str = "", participants: int = 0, seed: int | None = None) -> Design:
    """Parse a design from TOML.

    `name`, `participants` and `seed` override the text if given (not empty, not 0, not None). Raises InputError if the
    text is no TOML or no valid design; states where.
    """
    try:
        raw: dict[str, Any] = toml_of(text)
    except ValueError as wrong:
        raise InputError(f"study: expected TOML, got: {wrong}") from wrong
    given = {"name": name, "participants": participants, "seed": seed}
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
        cls, path: Path, text: str, design: Design, *, drives: Callable[[Path], Mapping[str, str]] | None = None
    ) -> "StudyFolder":
        """Draw the plan of a new study and store it atomically with its TOML `text`, readable by this user only.

        `drives` writes the drives into a folder and returns their digests by name; without it the plan has no drives.
        Raises FileError if the folder is not empty: a plan is never overwritten.
        """
        draw_plan(design)  # raises before the drives are solved, which takes long
        with atomic_folder(path) as partial:
            partial.chmod(0o700)
            plan = draw_plan(design, drives=drives(partial) if drives else None)
            content = json.dumps(asdict(plan), indent=1, ensure_ascii=False)
            for name, written in (("plan.toml", text), ("plan.json", content)):
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
        from midair.study.session.event_log import read_events

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
