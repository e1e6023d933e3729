"""Import of files of other programs: the command `midair import` with the options of a form, and a preview of it."""

import json
import re
import subprocess
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from midair.errors import InputError
from midair.files import open_take
from midair.processes import python_command
from midair.recordings import Path as Direction
from midair.recordings import Shape, Turn
from midair.streaming import blocks
from midair.studio.jobs import Progressed
from midair.studio.studio_state import Arguments

Text = Annotated[str, Field(max_length=100)]


class ImportForm(Arguments):
    """Options of `midair import`, each as it is typed there; an empty one is not given."""

    file: str = Field(max_length=300)
    felt: Literal["", "soft", "medium", "strong"] = ""
    unit: Literal["", "V", "count", "Pa"] = ""
    scale: Text = ""
    sensitivity: Text = ""
    peak: Text = ""
    rate: Text = ""
    time: Text = ""
    field: Text = ""
    decimal: Literal["", "point", "comma"] = ""
    mend: Text = ""
    channels: Text = ""
    layout: Text = ""
    resample: Text = ""
    footprint: Literal["", Shape] = ""
    size: Text = ""
    speed: Text = ""
    path: Literal["", Direction] = ""
    turn: Literal["", Turn] = ""
    save: bool = False

    def words(self) -> tuple[str, ...]:
        """Options of the command; those of a footprint only with one."""
        given = {name: str(getattr(self, name)) for name in OPTIONS if getattr(self, name)}
        if self.footprint:
            given["footprint"] = f"{self.footprint}:{self.size}"
        else:
            given = {name: value for name, value in given.items() if name not in ("speed", "path", "turn")}
        return tuple(f"--{name}={value}" for name, value in given.items())


OPTIONS = tuple(name for name in ImportForm.model_fields if name not in ("file", "size", "save"))
"""Names of the options, without ``--``."""


def run_import(order: tuple[str, str, tuple[str, ...]], progress: Progressed) -> dict[str, Any]:
    """Run `midair import` on a file; returns its figures and notes, and the course of the strongest channel.

    Facts that the file lacks are returned with the answers that the command proposes; other messages raise InputError.
    """
    source, target, words = order
    progress("importing", 0, 1)
    try:
        said = run_command("import", source, target, "--force", "--json", *words)
    except InputError as wrong:
        if not (facts := asked(str(wrong))):
            raise
        return {"asked": facts, "said": str(wrong)}
    return {**json.loads(said), "course": _course(target)}


def asked(said: str) -> dict[str, str]:
    """Options of the form that a message advises to give; the first of each advice with its value, others with ""."""
    advice = [re.findall(r"--(\w+) ([^\s,;]+)", each) for each in re.findall(r"; give ([^;]*)", said)]
    found = {name: "" if place else value for each in advice for place, (name, value) in enumerate(each)}
    return {name: value for name, value in found.items() if name in OPTIONS}


def run_command(*words: str) -> str:
    """Run a command of midair and return what it prints; InputError with its message, files without their folder."""
    done = subprocess.run(python_command("-m", "midair", *words), capture_output=True, text=True, check=False)
    if done.returncode:
        said = [line.removeprefix("midair: ") for line in done.stderr.splitlines() if line.startswith("midair: ")]
        wrong = said[-1] if said else f"{words[0]}: failed without a message"
        for place in (word for word in words if word.startswith("/")):
            wrong = wrong.replace(place, Path(place).name)
        raise InputError(wrong)
    return done.stdout


def run_words(words: tuple[str, ...], progress: Progressed) -> str:
    """Run a command of midair in a worker process; InputError with its message."""
    progress(f"midair {words[0]}", 0, 1)
    run_command(*words)
    return words[-1]


def run_edit(commands: tuple[tuple[str, ...], ...], progress: Progressed) -> dict[str, Any]:
    """Run commands that edit a recording; returns the course of the strongest channel of the result."""
    for words in commands:
        run_words(words, progress)
    return _course(commands[-1][-1])


def _course(path: str, columns: int = 400) -> dict[str, Any]:
    """Least and greatest value of the strongest channel in each of at most `columns` equal parts."""
    recording = open_take(path).recording
    samples = recording.samples
    size = max(1, -(-len(samples) // columns))
    parts = [block.reshape(len(block), -1) for block in blocks(samples, size)]
    least, greatest = (np.array([getattr(part, name)(axis=0) for part in parts]) for name in ("min", "max"))
    channel = int((greatest.max(axis=0) - least.min(axis=0)).argmax())
    ends = {"least": least[:, channel].tolist(), "greatest": greatest[:, channel].tolist()}
    return {"channel": channel, "seconds": recording.duration, **ends}
