"""Schema of midair's files: dimensions, type and unit of every stored name, for writers, readers and the docs."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from midair.errors import BrokenFileError
from midair.model import SensorGrid, TransducerArray

Kind = Literal["recording", "calibration", "pressure", "drive", "array", "played"]
"""Content of a file or group."""

FORMAT = 1
"""Version of the schema; it increases when an older reader would misread a file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A stored attribute or dataset."""

    name: str
    what: str
    """Meaning in a few words; ``long_name`` of a dataset."""
    dtype: Literal["f8", "i8", "i1", "u1", "text"] = "f8"
    """Little-endian; text is UTF-8 of fixed length, so that the checksum of HDF5 metadata covers it."""
    dimensions: tuple[str, ...] | None = None
    """Axes of a dataset, () for a single number; None for an attribute."""
    unit: str = ""
    """Attribute `units` of a dataset, "1" for a pure number, ``{unit}`` for the unit of the sensor's output; empty for
    attributes, whose names contain it."""
    required: bool = True
    single: bool = False
    """Whether it is stored as f4 if that holds every number."""
    packed: bool = False
    """Whether it is compressed."""

    @property
    def coordinate(self) -> bool:
        """True if it holds the coordinates of the axis of the same name."""
        return self.dimensions == (self.name,)


BLOCK = 64
"""Number of frames in a compressed chunk."""

_STORED = tomllib.loads(Path(__file__).with_name("schema.toml").read_text(encoding="utf-8"))


def _entries(listed: Iterable[Any]) -> Iterator[Entry]:
    """Entries of a list of the file, in which a name stands for a part."""
    for one in listed:
        if isinstance(one, str):
            yield from _entries(_STORED["part"][one])
        else:
            axes = one.get("dimensions")
            fields: dict[str, Any] = {**one, "dimensions": None if axes is None else tuple(axes.split())}
            yield Entry(**fields)


TABLE: Mapping[Kind, tuple[Entry, ...]] = {kind: tuple(_entries(listed)) for kind, listed in _STORED["kind"].items()}
"""Entries of each kind."""

PLAYED = ("phase_steps", "intensity", "instant", "state")
"""Values of a frame of live touch."""


def time_values(frames: int, rate: float) -> dict[str, Any]:
    """Stored values of the time axis for `frames` frames at `rate` (Hz)."""
    return {"rate_hz": rate, "time": np.arange(frames) / rate}


def sensor_values(sensor: SensorGrid) -> dict[str, Any]:
    """Stored values of a sensor."""
    return {
        "sensor_name": sensor.name,
        "sensor_pitch_m": sensor.pitch,
        "row": np.arange(sensor.rows),
        "column": np.arange(sensor.columns),
        "y": sensor.y,
        "x": sensor.x,
    }


def sensor_from(values: Mapping[str, Any]) -> SensorGrid:
    """Sensor from its stored values."""
    return SensorGrid(
        rows=len(values["row"]),
        columns=len(values["column"]),
        pitch=values["sensor_pitch_m"],
        name=values["sensor_name"],
    )


_ATTRIBUTES = {
    "array_name": "name",
    "array_pressure_pa_m": "pressure",
    "array_frequency_hz": "frequency",
    "transducer_position": "position",
    "transducer_normal": "normal",
    "transducer_unit": "unit",
}
"""Names in the file of the attributes of an array."""


def array_values(array: TransducerArray) -> dict[str, Any]:
    """Stored values of an array without the response of its transducers."""
    return {
        **{name: getattr(array, attribute) for name, attribute in _ATTRIBUTES.items()},
        "transducer": np.arange(array.count),
        "axis": np.arange(3),
    }


def array_from(values: Mapping[str, Any]) -> TransducerArray:
    """Array from its stored values, with transducers as the model's."""
    return TransducerArray(**{attribute: values[name] for name, attribute in _ATTRIBUTES.items()})


def check_time(values: Mapping[str, Any], path: Path) -> None:
    """Raise BrokenFileError if a stored time differs from frame / rate by more than a thousandth of a frame."""
    time, rate = values["time"], values["rate_hz"]
    right = np.abs(time * rate - np.arange(len(time))) < 1e-3
    if not right.all():
        wrong = int(np.argmin(right))
        raise BrokenFileError(
            f"{path}: expected frame i at i / {rate:g} Hz, got frame {wrong} at {time[wrong]:g} s; the file is damaged "
            "or its rate was edited"
        )


def single(samples: np.ndarray) -> np.ndarray:
    """Samples as float32 if that is lossless, otherwise unchanged."""
    with np.errstate(over="ignore"):
        small = samples.astype(np.float32)
    return small if np.array_equal(small, samples) else samples
