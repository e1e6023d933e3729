"""Where the text of a study enters: its TOML, checked by pydantic, and the folder that holds its plan and logs."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError

from midair.errors import BrokenFileError, InputError, MissingFileError
from midair.files import json_of, read_text, toml_of, whole_folder
from midair.study.design import (
    Design,
    Plan,
    SessionState,
    digest_of,
    draw_plan,
    replay,
)

Template = Literal["paper", "detection", "intervals", "paired"]
"""Studies that are shipped: section 5.3 of the paper; the threshold of a vibration; which of two intervals is the
stronger; all pairs compared."""


def template_text(template: Template) -> str:
    """TOML of a study that is shipped."""
    return files("midair.study").joinpath("templates", f"{template}.toml").read_text(encoding="utf-8")


def paper_design_text() -> str:
    """TOML of the paper's experiment (section 5.3)."""
    return template_text("paper")


def read_design(text: str, *, name: str = "", participants: int = 0, seed: int | None = None) -> Design:
    """A design from TOML.

    Parameters
    ----------
    text : str
        The TOML.
    name, participants, seed
        Take the place of what the text says, if given (not empty, not 0, not None).

    Raises
    ------
    InputError
        If the text is no TOML or does not describe a study; says where.
    """
    try:
        raw: dict[str, Any] = toml_of(text)
    except ValueError as wrong:
        raise InputError(f"study: expected TOML, got: {wrong}") from wrong
    given = {"name": name, "participants": participants, "seed": seed}
    raw |= {key: value for key, value in given.items() if value or (key == "seed" and value is not None)}
    # pydantic takes no settings beside a dataclass, but hands those of a tuple down to the dataclasses inside it.
    design = TypeAdapter(tuple[Design], config=ConfigDict(extra="forbid"))
    try:
        return design.validate_python((raw,))[0]
    except ValidationError as wrong:
        raise _in_words(wrong) from wrong


class StudyFolder:
    """A study on disk: ``plan.toml`` as it was written, ``plan.json`` as it was drawn, ``sessions/sub-NN.jsonl``.

    Parameters
    ----------
    path : Path
        The folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def create(
        cls, path: Path, text: str, design: Design, *, drives: Callable[[Path], Mapping[str, str]] | None = None
    ) -> "StudyFolder":
        """Draw the plan of a new study and store it, whole or not at all; for this user alone.

        Parameters
        ----------
        path : Path
            The new folder.
        text : str
            The TOML, kept beside the plan.
        design : Design
            What it says.
        drives : callable, optional
            Puts the drives into a folder and gives their digests by their names; the plan knows none if None.

        Raises
        ------
        FileError
            If the folder holds something already: a plan is never drawn twice.
        """
        draw_plan(design)  # what cannot be drawn is refused before drives are made, which takes its time
        with whole_folder(path) as partial:
            partial.chmod(0o700)
            plan = draw_plan(design, drives=drives(partial) if drives else None)
            content = json.dumps(asdict(plan), indent=1, ensure_ascii=False)
            for name, written in (("plan.toml", text), ("plan.json", content)):
                (partial / name).touch(mode=0o600)
                (partial / name).write_text(written, encoding="utf-8")
        return cls(path)

    def plan(self) -> Plan:
        """Read the plan back.

        Raises
        ------
        MissingFileError
            If there is none.
        BrokenFileError
            If it has been changed since it was drawn.
        """
        file = self.path / "plan.json"
        if not file.exists():
            raise MissingFileError(f"{self.path}: expected a study with a plan.json; make one with `midair study new`")
        try:
            content = json_of(read_text(file, "a plan"))
            found = digest_of(content["design"], content["trials"], content.get("drives"), content.get("chain", False))
            plan = TypeAdapter(Plan).validate_python(content)
        except (ValueError, KeyError, AttributeError, TypeError) as wrong:
            raise BrokenFileError(f"{file.name}: expected a plan, got something else; restore a copy") from wrong
        if plan.digest != found:
            raise BrokenFileError(f"{file.name}: expected plan {plan.digest}, got {found}; it was changed since")
        return plan

    def log(self, participant: int) -> Path:
        """Where the log of a participant is."""
        return self.path / "sessions" / f"sub-{participant:02d}.jsonl"

    def sessions(self) -> list[SessionState]:
        """Where every session that was begun stands."""
        plan = self.plan()
        return [self.session(plan, n) for n in range(1, plan.design.participants + 1) if self.log(n).exists()]

    def session(self, plan: Plan, participant: int) -> SessionState:
        """Where the session of one participant stands.

        Raises
        ------
        MissingFileError
            If it was not begun.
        BrokenFileError
            If its log was changed since it was written.
        MismatchError
            If the log belongs to another participant or another study.
        """
        from midair.study.session import read_events

        log = self.log(participant)
        return replay(read_events(log, chained=plan.chain), plan, participant, name=log.name)


def _in_words(wrong: ValidationError) -> InputError:
    """What a design itself refuses is said as it says it; for the rest, where in the TOML it stands."""
    first = wrong.errors()[0]
    refused = first.get("ctx", {}).get("error")
    if isinstance(refused, InputError):
        return refused
    where = ".".join(str(part) for part in first["loc"][1:])
    unknown = first["type"] == "unexpected_keyword_argument"
    message = "extra inputs are not permitted" if unknown else first["msg"][0].lower() + first["msg"][1:]
    return InputError(f"study: {where}: {message}; correct the TOML")
