"""Import of files of other programs: the command `midair import` with the options of a form, and a preview of it."""

import json
import re
import subprocess
from base64 import b64encode
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from midair.array_types import Array
from midair.datasets import PICTURES
from midair.errors import InputError
from midair.files import open_take
from midair.processes import python_command
from midair.streaming import blocks
from midair.studio.jobs import Progressed
from midair.studio.studio_state import Arguments

OPTIONS = (
    *("felt", "unit", "scale", "sensitivity", "peak", "rate", "time", "field", "decimal", "mend", "channels", "layout"),
    *("resample", "footprint", "speed", "path", "turn"),
)
"""Options of `midair import` in the form, without ``--``."""

Text = Annotated[str, Field(max_length=100)]
Option = Annotated[str, Field(pattern=f"^({'|'.join(OPTIONS)})$")]


class ImportForm(Arguments):
    """A file, and options of `midair import`, each as it is typed there; an empty one is not given."""

    file: str = Field(max_length=300)
    options: dict[Option, Text] = Field(default_factory=dict[Option, str])
    save: bool = False

    def words(self) -> tuple[str, ...]:
        """Options of the command."""
        return tuple(f"--{name}={value}" for name, value in self.options.items() if value)


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


def run_report(paths: tuple[Path, Path, Path], progress: Progressed) -> None:
    """Write the page of a recording and its re-recording, which lie beside it; InputError with a message."""
    take, again, page = paths
    progress("writing the report", 0, 1)
    run_command("compare", take.name, again.name, "--report", page.name, "--force", folder=take.parent)


def run_command(*words: str, folder: Path | None = None) -> str:
    """Run a command of midair and return what it prints; InputError with its message, files without their folder."""
    command = python_command("-m", "midair", *words)
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    if done.returncode:
        said = [line.removeprefix("midair: ") for line in done.stderr.splitlines() if line.startswith("midair: ")]
        wrong = said[-1] if said else f"{words[0]}: failed without a message"
        for place in (word for word in words if word.startswith("/")):
            wrong = wrong.replace(place, Path(place).name)
        raise InputError(wrong.removesuffix(" (see midair --help)").replace("Invalid value for ", ""))
    return done.stdout


def run_words(words: tuple[str, ...], progress: Progressed) -> str:
    """Run a command of midair in a worker process; InputError with its message."""
    progress(f"midair {words[0]}", 0, 1)
    try:
        run_command(*words)
    except InputError as wrong:  # a form has fields where the command has options
        raise InputError(re.sub(r'"?--(\w+)"?', lambda name: name[1].capitalize(), str(wrong))) from wrong
    return words[-1]


def run_edit(commands: tuple[tuple[str, ...], ...], progress: Progressed) -> dict[str, Any]:
    """Run commands that edit a recording; returns the course of the strongest channel of the result."""
    for words in commands:
        run_words(words, progress)
    return _course(commands[-1][-1])


def _course(path: str, columns: int = 800) -> dict[str, Any]:
    """Least and greatest values of the strongest channel, or of a footprint's sum, in at most `columns` parts."""
    recording = open_take(path).recording
    size, found = max(1, -(-recording.frames // columns)), list[tuple[Any, ...]]()
    for block in blocks(recording.samples, size):
        part = block.reshape(len(block), -1)
        whole = part.sum(axis=1)
        ends = np.append(part.min(axis=0), whole.min()), np.append(part.max(axis=0), whole.max())
        found.append((*ends, part.mean(axis=0), (part**2).mean(axis=0)))
    least, greatest, mean, square = (np.array(each) for each in zip(*found, strict=True))
    channel = int((greatest.max(axis=0) - least.min(axis=0))[:-1].argmax())
    shown = -1 if recording.provenance.last("footprint") else channel
    # An offset of the electronics is no pressure.
    rest = 0.0 if recording.unit == "Pa" else np.median(mean, axis=0)
    power = np.maximum(square - 2 * rest * mean + rest**2, 0)
    joined = max(1, round(recording.rate / PICTURES / size))
    pictures = [np.sqrt(power[at : at + joined].mean(axis=0)) for at in range(0, len(power), joined)]
    palm = np.reshape(pictures, (len(pictures), *recording.sensor.shape))[:, ::-1]
    return {
        "channel": channel,
        "seconds": recording.duration,
        "least": least[:, shown].tolist(),
        "greatest": greatest[:, shown].tolist(),
        "film": film_of(palm, recording.sensor.pitch, recording.duration),
    }


def film_of(pictures: Array, pitch: float, seconds: float) -> dict[str, Any]:
    """Rms pictures (picture, row, column) in 255 steps of their highest value, for the palm of a page.

    The first row is towards the fingers.
    """
    steps = np.rint(255 * pictures / max(float(pictures.max()), 1e-12)).astype(np.uint8)
    width = round(1e3 * pitch * pictures.shape[2])
    return {
        "shape": pictures.shape,
        "steps": b64encode(steps.tobytes()).decode(),
        "width_mm": width,
        "seconds": seconds,
    }
