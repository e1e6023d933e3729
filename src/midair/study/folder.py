"""Where the text of a study enters: its TOML, checked by pydantic, and the folder that holds its plan and logs."""

import json
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError

from midair.errors import BrokenFileError, InputError, MissingFileError
from midair.files import json_of, read_text, toml_of, whole_folder
from midair.study.design import (
    Design,
    Plan,
    Standing,
    digest_of,
    draw_plan,
    replay,
)


def paper_design_text() -> str:
    """TOML of the paper's experiment (section 5.3), shipped as the example."""
    return files("midair.study").joinpath("paper_study.toml").read_text(encoding="utf-8")


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
    def create(cls, path: Path, text: str, design: Design) -> "StudyFolder":
        """Draw the plan of a new study and store it, whole or not at all.

        Raises
        ------
        FileError
            If the folder holds something already: a plan is never drawn twice.
        """
        with whole_folder(path) as partial:
            content = json.dumps(asdict(draw_plan(design)), indent=1, ensure_ascii=False)
            (partial / "plan.toml").write_text(text, encoding="utf-8")
            (partial / "plan.json").write_text(content, encoding="utf-8")
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
            found = digest_of(content["design"], content["trials"])
            plan = TypeAdapter(Plan).validate_python(content)
        except (ValueError, KeyError, AttributeError, TypeError) as wrong:
            raise BrokenFileError(f"{file.name}: expected a plan, got something else; restore a copy") from wrong
        if plan.digest != found:
            raise BrokenFileError(f"{file.name}: expected plan {plan.digest}, got {found}; it was changed since")
        return plan

    def log(self, participant: int) -> Path:
        """Where the log of a participant is."""
        return self.path / "sessions" / f"sub-{participant:02d}.jsonl"

    def sessions(self) -> list[Standing]:
        """Where every session that was begun stands."""
        from midair.study.session import read_events

        plan = self.plan()
        numbers = [n for n in range(1, plan.design.participants + 1) if self.log(n).exists()]
        return [replay(read_events(self.log(n)), plan, n) for n in numbers]


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
