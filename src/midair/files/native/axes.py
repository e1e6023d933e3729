"""Time, sensor and array in the names of the schema, and the precision of samples."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import BrokenFileError
from midair.model import SensorGrid, TransducerArray
from midair.streaming import LazyFrames, blocks


def time_values(frames: int, rate: float) -> dict[str, Any]:
    """Stored values of the time axis for `frames` frames at `rate` (Hz)."""
    return {"rate_hz": rate, "time": LazyFrames(lambda first, last: np.arange(first, last) / rate, (frames,))}


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


_ARRAY = {
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
        **{name: getattr(array, attribute) for name, attribute in _ARRAY.items()},
        "transducer": np.arange(array.count),
        "axis": np.arange(3),
    }


def array_from(values: Mapping[str, Any]) -> TransducerArray:
    """Array from its stored values, with transducers as the model's."""
    return TransducerArray(**{attribute: values[name] for name, attribute in _ARRAY.items()})


def check_time(values: Mapping[str, Any], path: Path) -> None:
    """Raise BrokenFileError if a stored time differs from frame / rate by more than a thousandth of a frame."""
    first, rate = 0, values["rate_hz"]
    for block in blocks(values["time"]):
        right = np.abs(block * rate - np.arange(first, first + len(block))) < 1e-3
        if not right.all():
            wrong = int(np.argmin(right))
            raise BrokenFileError(
                f"{path}: expected frame i at i / {rate:g} Hz, got frame {first + wrong} at {block[wrong]:g} s; "
                "the file is damaged or its rate was edited"
            )
        first += len(block)


def single(samples: "np.ndarray | LazyFrames") -> "np.ndarray | LazyFrames":
    """Samples as float32 if that is lossless; otherwise, and for lazy frames, unchanged."""
    if isinstance(samples, LazyFrames):
        return samples
    with np.errstate(over="ignore"):
        small = samples.astype(np.float32)
    return small if np.array_equal(small, samples) else samples
