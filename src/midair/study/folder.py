"""Where the text of a study enters: its TOML, checked by pydantic, and the folder that holds its plan and logs."""

import json
import tomllib
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from midair.errors import BrokenFileError, FileError, InputError, MissingFileError
from midair.study.design import (
    Adaptive,
    Analysis,
    Block,
    Design,
    Order,
    Plan,
    Question,
    QuestionKind,
    Standing,
    Stimulus,
    StimulusKind,
    digest_of,
    draw_plan,
    replay,
)


class _Text(BaseModel):
    model_config = ConfigDict(extra="forbid")


class StimulusText(_Text):
    """A ``[[stimuli]]`` table."""

    name: str
    kind: StimulusKind = "drive"
    source: str = ""
    members: tuple[str, ...] = ()
    levels: dict[str, str] = {}


class QuestionText(_Text):
    """A ``[[questions]]`` table."""

    name: str
    kind: QuestionKind
    text: str
    options: tuple[str, ...] = ()
    low: int = 1
    high: int = 7
    low_label: str = ""
    high_label: str = ""
    truth: str = ""
    levels: dict[str, str] = {}


class BlockText(_Text):
    """A ``[[blocks]]`` table."""

    name: str
    stimuli: tuple[str, ...]
    questions: tuple[str, ...]
    repetitions: int = 1
    order: Order = "shuffle"
    longest_run: int = 0
    group: str = ""
    scored: bool = True
    levels: dict[str, str] = {}
    text: str = ""
    rest_s: float = 0.0
    adaptive: Adaptive = ""
    strength: str = ""


class AnalysisText(_Text):
    """The ``[analysis]`` table."""

    choice: str = ""
    condition: str = ""
    only: dict[str, str] = {}
    rated: tuple[str, ...] = ()
    within: tuple[str, ...] = ()
    strength: str = ""
    guess: float = 0.5
    margin: float = 0.1


class DesignText(_Text):
    """A study's TOML."""

    name: str
    title: str = ""
    participants: int
    seed: int
    counterbalanced: tuple[str, ...] = ()
    consent: str = ""
    debrief: str = ""
    stimuli: tuple[StimulusText, ...]
    questions: tuple[QuestionText, ...]
    blocks: tuple[BlockText, ...]
    analysis: AnalysisText = AnalysisText()

    def design(self) -> Design:
        """As the stages know it."""
        plain = self.model_dump(exclude={"stimuli", "questions", "blocks", "analysis"})
        return Design(
            **plain,
            stimuli=tuple(Stimulus(**part.model_dump()) for part in self.stimuli),
            questions=tuple(Question(**part.model_dump()) for part in self.questions),
            blocks=tuple(Block(**part.model_dump()) for part in self.blocks),
            analysis=Analysis(**self.analysis.model_dump()),
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
        raw: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as wrong:
        raise InputError(f"study: expected TOML, got: {wrong}") from wrong
    given = {"name": name, "participants": participants, "seed": seed}
    raw |= {key: value for key, value in given.items() if value or (key == "seed" and value is not None)}
    try:
        return DesignText.model_validate(raw).design()
    except ValidationError as wrong:
        first = wrong.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"study: {where}: {first['msg'][0].lower()}{first['msg'][1:]}; correct the TOML") from wrong


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
        """Draw the plan of a new study and store it.

        Raises
        ------
        FileError
            If the folder holds something already: a plan is never drawn twice.
        """
        if path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise FileError(f"{path.name}: expected a new folder, got one that holds something; choose another name")
        path.mkdir(parents=True, exist_ok=True)
        (path / "plan.toml").write_text(text, encoding="utf-8")
        content = json.dumps(asdict(draw_plan(design)), indent=1, ensure_ascii=False)
        (path / "plan.json").write_text(content, encoding="utf-8")
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
            content = json.loads(file.read_text(encoding="utf-8"))
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
