"""Read the takes of a calibration from files: recordings of the sensor and of the reference, at the same frames."""

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
    """The reference that measured the pressure."""

    sensitivity: float | None = None
    """Sensitivity in the reference recording's unit per Pa; None for a recording in Pa."""
    uncertainty: float = 0.0
    """Relative standard uncertainty (k = 1) of the sensitivity."""
    name: str = ""
    """Name of the reference; that of its file if empty."""
    channel: int | None = None
    """Channel of the sensor's recording that holds the reference; None for separate files."""


def read_takes(
    recordings: Sequence[Path],
    references: Sequence[Path],
    choice: ReferenceChoice,
    *,
    cells: Sequence[int | None] | None = None,
) -> tuple[list[ReferencedTake], list[str]]:
    """Read the takes, and return one sentence for each adjustment that made the pairs fit.

    Each recording of the sensor has a reference file, begun at the same moment, unless the references are a channel of
    the recordings. `cells` are the channels that were pressed, None for all cells; by default from the recordings'
    notes (``pressed``: ``cell 3`` or ``all cells``).

    MismatchError if the numbers of references or cells and of recordings differ, or the lengths of a pair differ;
    UnitError if a sensitivity is missing.
    """
    if (choice.channel is None) != bool(references):
        raise MismatchError(
            "reference: expected either separate files (--reference) or a channel of the recordings "
            f"(--reference-channel), got {'both' if references else 'neither'}"
        )
    for name, given in (("--reference", references or None), ("--cell", cells)):
        if given is not None and len(given) != len(recordings):
            raise MismatchError(
                f"{name}: expected one value for each of {len(recordings)} recordings, got {len(given)}"
            )
    takes: list[ReferencedTake] = []
    notes: list[str] = []
    for index, path in enumerate(recordings):
        recording = open_take(path).recording
        if choice.channel is not None:
            recording, said = split_channel(recording, choice.channel)
        else:
            said = open_take(references[index]).recording
        recording, said, changed = _match_frames(recording, said, path)
        notes += changed
        cell = _pressed_cell(recording, path) if cells is None else cells[index]
        reference = Reference.read(
            said, sensitivity=_sensitivity(said, choice), uncertainty=choice.uncertainty, name=choice.name
        )
        takes.append(ReferencedTake(recording=_with_source(recording, path), reference=reference, cell=cell))
    return takes, notes


def read_silence(path: Path) -> Recording:
    """Read a recording without pressure, named after its file."""
    return _with_source(open_take(path).recording, path)


def _match_frames(recording: Recording, said: Recording, path: Path) -> tuple[Recording, Recording, list[str]]:
    """Bring both to the sensor's rate and to the shorter length."""
    notes: list[str] = []
    if said.rate != recording.rate:
        notes.append(f"{path}: the reference was resampled from {said.rate:g} to {recording.rate:g} Hz")
        said = replace(said, samples=resample(said.samples, said.rate, recording.rate), rate=recording.rate)
    frames = min(recording.frames, said.frames)
    if max(recording.frames, said.frames) > 1.01 * frames:
        raise MismatchError(
            f"{path}: expected a reference as long as the recording, {recording.duration:.3f} s, got "
            f"{said.duration:.3f} s; record both from the same moment, or cut them to the same length"
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


def _pressed_cell(recording: Recording, path: Path) -> int | None:
    """Cell that the notes of a recording name; None for all cells."""
    note = recording.provenance.notes.get("pressed", "all cells")
    if note in ("all cells", "all"):
        return None
    number = note.removeprefix("cell").strip()
    if not number.isdecimal():
        raise InputError(
            f"{path}: expected a note 'pressed' such as 'cell 3' or 'all cells', got {note!r}; give --cell"
        )
    return int(number)


def _with_source(recording: Recording, path: Path) -> Recording:
    """Return the recording with its file's name as source."""
    return replace(recording, provenance=replace(recording.provenance, source=path.name))
