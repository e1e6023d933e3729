"""Schema of midair's files: dimensions, type and unit of every stored name, for writers, readers and the docs."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from midair.errors import BrokenFileError
from midair.model import SensorGrid, TransducerArray
from midair.streaming import LazyFrames, blocks

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


def attribute(name: str, dtype: Literal["f8", "i8", "text"], what: str, *, required: bool = True) -> Entry:
    """Entry of an attribute."""
    return Entry(name=name, what=what, dtype=dtype, required=required)


def numbers(name: str, dimensions: str, unit: str, what: str, **more: Any) -> Entry:
    """Entry of a float64 dataset; `dimensions` are separated by spaces, `more` are other fields."""
    return Entry(name=name, what=what, dimensions=tuple(dimensions.split()), unit=unit, **more)


def indices(
    name: str, dimensions: str, what: str, *, required: bool = True, dtype: Literal["i8", "i1", "u1"] = "i8"
) -> Entry:
    """Entry of an integer dataset; `dimensions` are separated by spaces."""
    axes = tuple(dimensions.split())
    return Entry(name=name, what=what, dtype=dtype, dimensions=axes, unit="1", required=required)


def changes(name: str, what: str) -> Entry:
    """Compressed bytes: the change since the frame before, modulo 256; every `BLOCK` frames the byte itself."""
    return replace(indices(name, "time transducer", what, required=False, dtype="u1"), packed=True)


BLOCK = 64
"""Number of frames whose changes can be read without the frames before."""

_SIGNED = (
    attribute("kind", "text", "midair and what it holds: recording, calibration, pressure, drive, array or played"),
    attribute("format", "i8", "version of this table"),
    attribute("created", "text", "when the file was made, ISO 8601, UTC"),
    attribute("created_by", "text", "midair and its version"),
    attribute("provenance", "text", "source, simulated, notes and steps, JSON"),
)
# HDF5 has no checksum for attributes of more than 4 kB.
_DIGEST = attribute("provenance_digest", "text", "SHA-256 of the provenance", required=False)
_SENSOR = (
    attribute("sensor_name", "text", "which sensor"),
    attribute("sensor_pitch_m", "f8", "distance between neighbouring cells, m"),
    indices("row", "row", "of the sensor, from 0; y grows with it"),
    indices("column", "column", "of the sensor, from 0; x grows with it"),
    numbers("y", "row", "m", "of a row from the centre of the sensor"),
    numbers("x", "column", "m", "of a column from the centre of the sensor"),
)
_TIME = (
    attribute("rate_hz", "f8", "frames per second, Hz"),
    numbers("time", "time", "s", "of a frame: its number over the rate"),
)
_UNIT = (attribute("unit", "text", "of the sensor's output: V, count or Pa"),)
_EVENTS = (
    indices("event", "event", "of what happened while it was recorded, from 0", required=False),
    indices("event_kind", "event", "what happened; flag_meanings names the numbers", required=False, dtype="i1"),
    indices("event_frame", "event", "first frame that it concerns", required=False),
    indices("event_frames", "event", "how many frames it concerns; lost ones hold the last good frame", required=False),
    indices("event_channel", "event", "of the sensor, or -1 for all", required=False),
    numbers("event_ppm", "event", "1e-6", "how much faster than the computer's clock, for rate, clock", required=False),
)
_STAGE = (
    indices("stage", "stage", "of a place where the stage was, from 0", required=False),
    numbers("stage_time", "stage", "s", "when it was there, from frame 0 on", required=False),
    numbers("stage_x", "stage", "m", "place in the machine's coordinates", required=False),
    numbers("stage_y", "stage", "m", "place in the machine's coordinates", required=False),
    numbers("stage_z", "stage", "m", "place in the machine's coordinates; grows away from the sensor", required=False),
    numbers("stage_feed", "stage", "m/s", "speed as the machine said it", required=False),
)
_MEASUREMENT = (
    attribute("method", "text", "how a measured calibration was made, in words", required=False),
    attribute("reference", "text", "what the pressure was measured by", required=False),
    attribute("reference_uncertainty", "f8", "part of the magnitude that all bins share, k = 1", required=False),
    attribute("takes", "i8", "number of recordings that it rests on", required=False),
    numbers("coherence", "frequency row column", "1", "share of the output that is explained", required=False),
    numbers(
        "magnitude_uncertainty", "frequency row column", "1", "of the magnitude, a part of it, k = 1", required=False
    ),
    numbers("phase_uncertainty", "frequency row column", "rad", "of the response's phase, k = 1", required=False),
    numbers(
        "noise_density", "frequency row column", "{unit}/sqrt(Hz)", "noise of the output, one-sided", required=False
    ),
    numbers("noise_uncertainty", "row column", "1", "of noise, as a part of it, k = 1", required=False),
    numbers("delay", "row column", "s", "of a channel behind the reference", required=False),
    numbers("delay_uncertainty", "row column", "s", "of the delay, k = 1", required=False),
)
_CROSSTALK = (
    indices("channel", "channel", "that hears, row by row, from 0", required=False),
    indices("pressed", "pressed", "channel whose cell is pressed, from 0", required=False),
    numbers("crosstalk", "channel pressed", "1", "pressure that a cell feels over that on another", required=False),
    numbers("crosstalk_uncertainty", "channel pressed", "1", "of it, k = 1", required=False),
)
_LINEARITY = (
    indices("level", "level", "of the pressure, weakest first, from 0", required=False),
    numbers("level_pressure", "level row column", "Pa", "rms of the pressure", required=False),
    numbers("level_output", "level row column", "Pa", "rms of the output over the response", required=False),
    *(
        numbers(f"{name}{end}", "row column", unit, f"{what}{', k = 1' if end else ''}", required=False)
        for name, unit, what in (
            ("gain", "1", "slope of output over pressure"),
            ("intercept", "Pa", "output at no pressure"),
            ("curvature", "1", "change of the slope over the levels, a part of it"),
        )
        for end in ("", "_uncertainty")
    ),
)

_ARRAY = (
    attribute("array_name", "text", "which array"),
    attribute("array_pressure_pa_m", "f8", "peak pressure of one transducer on its axis times distance, Pa m"),
    attribute("array_frequency_hz", "f8", "of the ultrasound, Hz"),
    indices("transducer", "transducer", "of the array, from 0"),
    indices("axis", "axis", "0, 1, 2 for x, y, z"),
    numbers("transducer_position", "transducer axis", "m", "from the centre of the array; z towards the palm"),
    numbers("transducer_normal", "transducer axis", "1", "unit vector along which it radiates"),
    indices("transducer_unit", "transducer", "device of the array that it belongs to, from 0"),
)

TABLE: Mapping[Kind, tuple[Entry, ...]] = {
    "recording": (
        *_SIGNED,
        _DIGEST,
        *_UNIT,
        *_TIME,
        *_SENSOR,
        numbers(
            "samples", "time row column", "{unit}", "what the sensor said; NaN where nothing was written", single=True
        ),
        indices("finished", "", "1 when the recording was closed in order, 0 while it runs", dtype="i1"),
        *_EVENTS,
        *_STAGE,
    ),
    "calibration": (
        *_SIGNED,
        _DIGEST,
        *_UNIT,
        *_SENSOR,
        attribute("date", "text", "when the calibration was made, ISO 8601, or empty"),
        numbers("frequency", "frequency", "Hz", "of a bin"),
        numbers("response_real", "frequency row column", "{unit}/Pa", "output over pressure, real part"),
        numbers("response_imag", "frequency row column", "{unit}/Pa", "output over pressure, imaginary part"),
        numbers("noise", "row column", "{unit}/sqrt(Hz)", "one-sided noise density of the output"),
        attribute("version", "i8", "of this sensor's calibration, from 1", required=False),
        *_MEASUREMENT,
        *_CROSSTALK,
        *_LINEARITY,
    ),
    "pressure": (
        *_SIGNED,
        _DIGEST,
        *_TIME,
        *_SENSOR,
        attribute("band_low_hz", "f8", "lower end of the band that was kept, Hz", required=False),
        attribute("band_high_hz", "f8", "upper end of the band that was kept, Hz", required=False),
        numbers("pressure", "time row column", "Pa", "calibrated pressure"),
    ),
    "drive": (
        *_SIGNED,
        _DIGEST,
        *_TIME,
        *_ARRAY,
        attribute("directivity", "text", "of a transducer, that the phases are for", required=False),
        attribute("air_density_kg_m3", "f8", "of the air that the phases are for, kg/m3", required=False),
        attribute("air_speed_m_s", "f8", "of sound in it, m/s", required=False),
        attribute("air_attenuation_np_m", "f8", "of amplitude in it, Np/m", required=False),
        attribute("air_alpha", "f8", "1 + power reflection coefficient of the surface", required=False),
        attribute("air_temperature_c", "f8", "where it was stated, degrees Celsius", required=False),
        attribute("air_humidity", "f8", "relative, where it was stated, 0 to 1", required=False),
        numbers("response_real", "transducer", "1", "of each that was measured, over the model's", required=False),
        numbers("response_imag", "transducer", "1", "its imaginary part", required=False),
        numbers("phase", "time transducer", "rad", "of the drive, for arrays other than AUTD3", required=False),
        changes("phase_change", "phase in 256 steps to a turn, as change since the frame before; bytes each 64 frames"),
        numbers("level", "time", "1", "of full drive, 0 to 1, when a frame has one level", required=False),
        numbers("transducer_level", "time transducer", "1", "of full drive, 0 to 1, otherwise", required=False),
        changes("intensity_change", "level in 255 steps, as change since the frame before; bytes each 64 frames"),
        numbers("error", "time", "1", "E of the frame: norm of the missing sound over norm of the wanted"),
        indices("iterations", "time", "that the solver made"),
        indices("status", "time", "how the solver ended; flag_meanings names the numbers", dtype="i1"),
        attribute("grid_rows", "i8", "of the control grid", required=False),
        attribute("grid_columns", "i8", "of the control grid", required=False),
        attribute("grid_pitch_m", "f8", "distance between neighbouring control points, m", required=False),
        attribute("grid_height_m", "f8", "of the control grid above the array, m", required=False),
        attribute("grid_centre_x_m", "f8", "x of the middle of the control grid, m", required=False),
        attribute("grid_centre_y_m", "f8", "y of the middle of the control grid, m", required=False),
        attribute("target_provenance", "text", "of the target, JSON", required=False),
        attribute("target_provenance_digest", "text", "SHA-256 of it", required=False),
        indices("point", "point", "of the control grid, row by row, from 0", required=False),
        numbers("target", "time point", "Pa", "peak target sound", required=False, single=True, packed=True),
    ),
    "array": (
        *_SIGNED,
        _DIGEST,
        *_ARRAY,
        attribute("date", "text", "when it was measured, ISO 8601, or empty"),
        attribute("level_uncertainty", "f8", "what the magnitudes of the responses share, a part of them, k = 1"),
        numbers("response_real", "transducer", "1", "settled under full drive, over the model's"),
        numbers("response_imag", "transducer", "1", "its imaginary part"),
        numbers("pole_real", "transducer", "rad/s", "less one over the time constant"),
        numbers("pole_imag", "transducer", "rad/s", "resonance less drive"),
        numbers("strength_uncertainty", "transducer", "1", "of the magnitude of the response, k = 1"),
        numbers("phase_uncertainty", "transducer", "rad", "of its phase, k = 1"),
        numbers("resonance_uncertainty", "transducer", "Hz", "of the resonance, k = 1"),
        numbers("quality_uncertainty", "transducer", "1", "of the quality factor, a part of it, k = 1"),
        indices("dead", "transducer", "1 where nothing was heard", dtype="i1"),
        indices("pose", "pose", "seven numbers a unit: x, y, z, rotation about x, y, z, time offset", required=False),
        numbers("unit_pose", "pose", "1", "each in m, rad or s, off the nominal place of its unit", required=False),
        numbers("unit_pose_covariance", "pose pose", "1", "of these numbers", required=False),
    ),
    "played": (
        *_SIGNED,
        _DIGEST,
        *_TIME,
        *_ARRAY,
        indices("phase_steps", "time transducer", "of what was formed, of 256 to a turn", dtype="u1"),
        indices("intensity", "time", "that all transducers were told, of 255 at full drive; 0 is silence", dtype="u1"),
        indices("instant", "time", "at which it was to sound, ns of the units' time; 0 where it had none"),
        indices("state", "time", "1 it sounded, 2 late: the one before stood on, 4 never felt; sums", dtype="i1"),
    ),
}
"""Entries of each kind."""


HEADER: tuple[Entry, ...] = (
    *_SIGNED,
    *_UNIT,
    attribute("frames", "i8", "number of frames: fewer samples mean that the file was cut"),
    attribute("rate_hz", "f8", "frames per second, Hz"),
    attribute("sensor", "text", "rows, columns, pitch_m and name"),
    attribute("scale_exponent", "i8", "of the power of two that full scale stands for, in a WAV", required=False),
)
"""Entries of the JSON header of CSV, WAV, NPZ and MAT files."""

NETCDF: tuple[Entry, ...] = (
    attribute("Conventions", "text", "the edition of the CF conventions that the names follow"),
    attribute("title", "text", "which sensor"),
    attribute("source", "text", "device or file that it came from, and whether it was SIMULATED"),
    attribute("history", "text", "the steps of its provenance by name"),
    attribute("comment", "text", "who wrote the file, and where its provenance is"),
)
"""Additional attributes of NetCDF exports, which NetCDF programs expect."""


def as_markdown(entries: Iterable[Entry]) -> str:
    """Table of entries in Markdown, for the docs."""
    lines = ["| name | stored as | dimensions | type | unit | meaning |", "| --- | --- | --- | --- | --- | --- |"]
    for entry in entries:
        stored = "attribute" if entry.dimensions is None else "dataset"
        name = f"`{entry.name}`" if entry.required else f"`{entry.name}` (optional)"
        axes = ", ".join(entry.dimensions or ())
        kind = f"{entry.dtype} or f4" if entry.single else entry.dtype
        lines.append(f"| {name} | {stored} | {axes} | {kind} | {entry.unit} | {entry.what} |")
    return "\n".join(lines)


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
