"""Takes of a calibration from files: the sensor's recording and the reference's, brought to the same frames."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from midair.calibration import Reference, ReferencedTake, split_channel
from midair.dsp import resample
from midair.errors import InputError, MismatchError, UnitError
from midair.files import open_take
from midair.model import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceChoice:
    """What measured the pressure, and where its signal is.

    Attributes
    ----------
    sensitivity : float or None
        Output over pressure, in the reference recording's unit per Pa; None for a recording in Pa.
    uncertainty : float
        Standard (k = 1), as a part of the sensitivity.
    name : str
        Name of the reference; what its file says if empty.
    channel : int or None
        Channel of the sensor's own recording on which the reference is; None for files of its own.
    """

    sensitivity: float | None = None
    uncertainty: float = 0.0
    name: str = ""
    channel: int | None = None


def read_takes(
    recordings: Sequence[Path],
    references: Sequence[Path],
    choice: ReferenceChoice,
    *,
    cells: Sequence[int | None] | None = None,
) -> tuple[list[ReferencedTake], list[str]]:
    """The takes in files, and one sentence for each thing that was changed to make them fit.

    Parameters
    ----------
    recordings : sequence of Path
        Recordings of the sensor.
    references : sequence of Path
        Files of the reference, one for each, begun at the same moment; none if it is on a channel of the recordings.
    choice : ReferenceChoice
        What measured the pressure.
    cells : sequence of int or None, optional
        The channel whose cell was pressed in each recording, None for all cells; what the recordings' notes say
        (``pressed``: ``cell 3`` or ``all cells``) if not given.

    Raises
    ------
    MismatchError
        If there are not as many references or cells as recordings, or a pair is not of the same length.
    UnitError
        If a sensitivity is missing.
    """
    if (choice.channel is None) != bool(references):
        raise MismatchError(
            "reference: expected either files of its own (--reference) or a channel of the recordings "
            f"(--reference-channel), got {'both' if references else 'neither'}"
        )
    for name, given in (("--reference", references or None), ("--cell", cells)):
        if given is not None and len(given) != len(recordings):
            raise MismatchError(f"{name}: expected one for each of {len(recordings)} recordings, got {len(given)}")
    takes: list[ReferencedTake] = []
    notes: list[str] = []
    for index, path in enumerate(recordings):
        recording = open_take(path).recording
        if choice.channel is not None:
            recording, said = split_channel(recording, choice.channel)
        else:
            said = open_take(references[index]).recording
        recording, said, changed = _alike(recording, said, path)
        notes += changed
        cell = _pressed(recording, path) if cells is None else cells[index]
        reference = Reference.read(
            said, sensitivity=_sensitivity(said, choice), uncertainty=choice.uncertainty, name=choice.name
        )
        takes.append(ReferencedTake(recording=_named(recording, path), reference=reference, cell=cell))
    return takes, notes


def read_quiet(path: Path) -> Recording:
    """A recording in which nothing presses, called by its file's name."""
    return _named(open_take(path).recording, path)


def _alike(recording: Recording, said: Recording, path: Path) -> tuple[Recording, Recording, list[str]]:
    """Both at the sensor's rate and of the shorter one's length."""
    notes: list[str] = []
    if said.rate != recording.rate:
        notes.append(f"{path}: the reference was resampled from {said.rate:g} to {recording.rate:g} Hz")
        said = replace(said, samples=resample(said.samples, said.rate, recording.rate), rate=recording.rate)
    frames = min(recording.frames, said.frames)
    if max(recording.frames, said.frames) > 1.01 * frames:
        raise MismatchError(
            f"{path}: expected a reference as long as the recording's {recording.duration:.3f} s, got "
            f"{said.duration:.3f} s; record both from the same moment, or cut them"
        )
    if recording.frames != said.frames:
        notes.append(f"{path}: recording and reference were cut to {frames} frames")
    return replace(recording, samples=recording.samples[:frames]), replace(said, samples=said.samples[:frames]), notes


def _sensitivity(said: Recording, choice: ReferenceChoice) -> float:
    if choice.sensitivity is not None:
        return choice.sensitivity
    if said.unit != "Pa":
        raise UnitError(
            f"reference: expected its sensitivity for a recording in {said.unit}, got none; state it as on its "
            f"certificate (--reference-sensitivity 50m{said.unit}/Pa)"
        )
    return 1.0


def _pressed(recording: Recording, path: Path) -> int | None:
    """The cell that the notes of a recording name; None for all of them."""
    note = recording.provenance.notes.get("pressed", "all cells")
    if note in ("all cells", "all"):
        return None
    number = note.removeprefix("cell").strip()
    if not number.isdecimal():
        raise InputError(f"{path}: expected a note pressed that says cell 3 or all cells, got {note!r}; give --cell")
    return int(number)


def _named(recording: Recording, path: Path) -> Recording:
    """The recording with its file's name as its source."""
    return replace(recording, provenance=replace(recording.provenance, source=path.name))
