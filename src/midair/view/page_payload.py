"""Data of a view for a page: metadata as JSON, and the frames of each track as binary sections."""

import base64
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.view.frame_encoding import TABLES, Kind, Section, colour_table, encode_counts, pack, phase_counts
from midair.view.view_data import Channels, Sound, ViewData

CHUNK = 250
"""Frames per section; each section has its own unit, so that quiet frames keep a fine resolution."""

PHASE_ROWS = 1000
"""Largest number of frames with phases in a page; longer drives are thinned out."""

FINE_FRAMES = 1500
"""Fields of at most so many frames have 16 bits (0.01 % of the maximum), longer ones 8 bits (1 %)."""


def metadata(showing: ViewData) -> dict[str, object]:
    """Return metadata for JSON: lengths in mm, tables and matrices as base64 text."""
    data: dict[str, object] = {
        "title": showing.title,
        "simulated": showing.simulated,
        "rate": showing.rate,
        "frames": showing.frames,
        "first": showing.first,
        "channel": showing.channel,
        "channels": 1 if showing.samples is None else showing.samples.values.shape[1],
        "marks": [],
        "colours": {name: _text(colour_table(name).tobytes()) for name in TABLES},
        "tracks": list(_tracks(showing)),
        "sensor": None,
    }
    if showing.sensor is not None:
        cells = showing.sensor
        data["sensor"] = {"rows": cells.rows, "columns": cells.columns, "pitch": 1e3 * cells.pitch}
    if showing.sound is not None:
        data.update(_plane(showing.sound))
    return data


def sections(showing: ViewData) -> dict[str, bytes]:
    """Return the packed frames of each track."""
    packed: dict[str, bytes] = {}
    for name, channels in _channels(showing):
        packed[name] = _counts(channels.values, Kind.SAMPLES, "<i2", showing)
    sound = showing.sound
    if sound is not None and sound.wanted is not None:
        packed["wanted"] = _counts(sound.wanted, Kind.FIELD, "u1", showing)
    if sound is not None and sound.played is not None:
        dtype = "<i2" if showing.frames <= FINE_FRAMES else "i1"
        packed["played"] = _counts(sound.played, Kind.FIELD, dtype, showing)
    if sound is not None and sound.drive is not None:
        packed["phases"] = pack(_phases(sound, showing))
    return packed


def size_of(showing: ViewData) -> int:
    """Estimate the size of all sections in bytes, without packing them."""
    width, sound = 0, showing.sound
    for _, channels in _channels(showing):
        width += 2 * channels.values.shape[1]
    if sound is not None:
        width += sound.grid.count * (sound.wanted is not None)
        width += sound.grid.count * (sound.played is not None) * (4 if showing.frames <= FINE_FRAMES else 2)
    kept = -(-showing.frames // _every(showing.frames))
    rows = 0 if sound is None or sound.drive is None else kept * sound.drive.array.count
    return width * showing.frames + rows


def check_size(showing: ViewData, *, most: int = 64 * 2**20) -> None:
    """Raise InputError if the frames of a view are more than `most` bytes, too many for one page."""
    size = size_of(showing)
    if size > most:
        raise InputError(
            f"page: expected at most {most / 1e6:.3g} MB of frames for a browser, got {size / 1e6:.3g} MB; "
            "show a part (--start-at, --duration)"
        )


def _channels(showing: ViewData) -> Iterator[tuple[str, Channels]]:
    if showing.samples is not None:
        yield "samples", showing.samples
    if showing.again is not None:
        yield "again", showing.again


def _tracks(showing: ViewData) -> Iterator[dict[str, object]]:
    for name, channels in _channels(showing):
        yield {"name": name, "unit": channels.unit, "label": channels.label}
    sound = showing.sound
    if sound is None:
        return
    if sound.wanted is not None:
        yield {"name": "wanted", "unit": "Pa", "label": "target"}
    if sound.played is not None:
        yield {"name": "played", "unit": "Pa", "label": "played"}
    if sound.drive is not None:
        yield {"name": "phases", "sparse": True}


def _plane(sound: Sound) -> dict[str, object]:
    grid = sound.grid
    place = {"pitch": 1e3 * grid.pitch, "x": 1e3 * grid.centre[0], "y": 1e3 * grid.centre[1]}
    field: dict[str, object] = {"rows": grid.rows, "columns": grid.columns, "place": place}
    for name in () if sound.finer is None else ("down", "across"):
        field[name] = _text(np.asarray(getattr(sound.finer, name), "<f4").tobytes())
    data: dict[str, object] = {"field": field, "top": sound.top, "played": "Played, simulated"}
    if sound.drive is not None:
        data["positions"] = np.round(1e3 * sound.drive.array.position[:, :2], 2).ravel().tolist()
    return data


def _counts(values: NDArray[np.float64] | NDArray[np.complex128], kind: Kind, dtype: str, showing: ViewData) -> bytes:
    return pack(
        encode_counts(values[at : at + CHUNK], kind, dtype=dtype, first=showing.first + at, rate=showing.rate)
        for at in range(0, len(values), CHUNK)
    )


def _phases(sound: Sound, showing: ViewData) -> Iterator[Section]:
    """Return one section per frame, since frames may be left out."""
    if sound.drive is None:
        return
    for frame in range(0, showing.frames, _every(showing.frames)):
        phase = sound.drive.phase[frame : frame + 1]
        yield phase_counts(phase, first=showing.first + frame, rate=showing.rate)


def _every(frames: int) -> int:
    """Interval between the frames whose phases a page keeps."""
    return -(-frames // PHASE_ROWS)


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()
