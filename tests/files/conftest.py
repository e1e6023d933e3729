import json
import struct
from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
import pytest

from midair.model import (
    Acoustics,
    AmplitudeFrames,
    Calibration,
    ControlGrid,
    Crosstalk,
    Drive,
    Linearity,
    Measurement,
    Medium,
    Provenance,
    Recording,
    SensorGrid,
    Solution,
    TransducerArray,
)

CALIBRATION_BINS = ("coherence", "magnitude_uncertainty", "phase_uncertainty", "noise_density")
CALIBRATION_LINE = [f"{name}{end}" for name in ("gain", "intercept", "curvature") for end in ("", "_uncertainty")]


@pytest.fixture(scope="session")
def provenance() -> Provenance:
    life = Provenance(source="virtual:towel é", simulated=True, notes={"object": 'towel, "wet"\n\u2028µ'})
    return life.then("record", {"band": (20.0, 470.0), "n": 3, "on": True, "none": None, "deep": ("a", (1, 2.5))})


@pytest.fixture(scope="session")
def recording(provenance: Provenance) -> Recording:
    samples = np.random.default_rng(7).normal(size=(40, 3, 5))
    sensor = SensorGrid(rows=3, columns=5, pitch=7e-3, name="palm µ")
    return Recording(samples=samples, rate=1000 / 3, sensor=sensor, unit="Pa", provenance=provenance)


@pytest.fixture
def options(recording: Recording) -> dict[str, Any]:
    """Options that the writer of `recording` needs."""
    return {"rate": recording.rate, "sensor": recording.sensor, "unit": "Pa", "provenance": recording.provenance}


@pytest.fixture(scope="session")
def calibration(recording: Recording) -> Calibration:
    rng = np.random.default_rng(8)
    shape = recording.sensor.shape
    return Calibration(
        sensor=recording.sensor,
        frequency=np.array([0.0, 20.0, 470.0]),
        response=rng.normal(size=(3, *shape)) + 1j * rng.normal(size=(3, *shape)),
        noise=rng.random(shape),
        unit="V",
        date="2026-11-20",
        provenance=Provenance(source="bench"),
        version=3,
        measurement=Measurement(
            **{name: rng.random((3, *shape)) for name in CALIBRATION_BINS},
            **{name: rng.random(shape) for name in ("noise_uncertainty", "delay", "delay_uncertainty")},
            reference_uncertainty=0.01,
            reference="force cell µ",
            method="sweeps",
            takes=7,
        ),
        crosstalk=Crosstalk(matrix=np.eye(15) + np.triu(rng.random((15, 15)), 1), uncertainty=rng.random((15, 15))),
        linearity=Linearity(
            **{name: rng.random((5, *shape)) for name in ("pressure", "output")},
            **{name: rng.random(shape) for name in CALIBRATION_LINE},
        ),
    )


@pytest.fixture(scope="session")
def solution(provenance: Provenance) -> Solution:
    rng = np.random.default_rng(9)
    array = TransducerArray.autd3(columns=1, rows=1)
    drive = Drive(
        phase=rng.integers(0, 256, (4, array.count)) / (256 / (2 * np.pi)),
        level=rng.random(4),
        rate=1000,
        array=array,
        acoustics=Acoustics(medium=Medium.at(temperature=24.5, humidity=0.4), directivity="piston"),
        provenance=provenance,
    )
    status = ("converged", "iterations", "stalled", "silent")
    return Solution(drive=drive, error=rng.random(4), iterations=np.array([50, 20, 20, 0]), status=status)


@pytest.fixture(scope="session")
def target(solution: Solution) -> AmplitudeFrames:
    grid = ControlGrid(rows=2, columns=3, pitch=4e-3, height=0.15, centre=(1e-3, -2e-3))
    amplitude = np.float32(np.random.default_rng(10).random((4, 6)) * 3000)
    return AmplitudeFrames(amplitude=amplitude, rate=1000, grid=grid, provenance=Provenance(source="prepare"))


@pytest.fixture(scope="session")
def alike() -> Callable[[Recording, Recording], None]:
    def check(one: Recording, other: Recording) -> None:
        np.testing.assert_array_equal(one.samples, other.samples)
        assert (one.rate, one.unit, one.sensor) == (other.rate, other.unit, other.sensor)
        assert one.provenance == other.provenance

    return check


def _xdf_chunk(tag: int, content: bytes) -> bytes:
    return b"\x04" + struct.pack("<IH", len(content) + 2, tag) + content


@pytest.fixture(scope="session")
def xdf() -> Callable[..., bytes]:
    """An XDF file by its specification (sccn/xdf, 1.0): header, stream header, samples, clock offsets, footer."""

    def build(samples, *, rate=1000.0, stamps=None, labels=(), unit="", name="skin", number=1, start=100.0) -> bytes:
        samples = np.asarray(samples, "<f4")
        stamps = start + np.arange(len(samples)) / rate if stamps is None else stamps
        channels = "".join(
            f"<channel><label>{label}</label><unit>{unit}</unit></channel>" for label in labels[: samples.shape[1]]
        )
        head = (
            f"<?xml version='1.0'?><info><name>{name}</name><type>touch</type>"
            f"<channel_count>{samples.shape[1]}</channel_count><nominal_srate>{rate}</nominal_srate>"
            f"<channel_format>float32</channel_format><source_id>bench</source_id>"
            f"<desc><channels>{channels}</channels></desc></info>"
        )
        stream = struct.pack("<I", number)
        rows = b"".join(
            b"\x08" + struct.pack("<d", stamp) + row.tobytes() for stamp, row in zip(stamps, samples, strict=True)
        )
        clock = b"".join(_xdf_chunk(4, stream + struct.pack("<dd", start + i, 0.0)) for i in range(3))
        return (
            _xdf_chunk(2, stream + head.encode())
            + _xdf_chunk(3, stream + b"\x04" + struct.pack("<I", len(samples)) + rows)
            + clock
            + _xdf_chunk(6, stream + b"<info><sample_count>1</sample_count></info>")
        )

    def whole(*streams: bytes) -> bytes:
        return b"XDF:" + _xdf_chunk(1, b"<?xml version='1.0'?><info><version>1.0</version></info>") + b"".join(streams)

    build.whole = whole
    return build


@pytest.fixture(scope="session")
def tdms() -> Callable[..., bytes]:
    """A TDMS segment as described by National Instruments."""

    def text(value: str, order: str) -> bytes:
        return struct.pack(order + "I", len(value.encode())) + value.encode()

    def properties(values: dict, order: str) -> bytes:
        parts = [struct.pack(order + "I", len(values))]
        for key, value in values.items():
            if isinstance(value, str):
                parts.append(text(key, order) + struct.pack(order + "I", 0x20) + text(value, order))
            else:
                parts.append(text(key, order) + struct.pack(order + "Id", 10, value))
        return b"".join(parts)

    def segment(columns, *, order="<", interleaved=False, chunks=1, group="skin", said=None, meta=True) -> bytes:
        """`columns` maps names of channels to arrays, cut into `chunks` chunks."""
        said = {"wf_increment": 1e-3, "unit_string": "V"} if said is None else said
        codes = {"i2": 2, "i4": 3, "u1": 5, "f4": 9, "f8": 10}
        head = struct.pack(order + "I", len(columns) + 1)
        head += text(f"/'{group}'", order) + struct.pack(order + "II", 0xFFFFFFFF, 0)
        raw = [b""] * chunks
        arrays = {
            name: np.asarray(column).astype(np.asarray(column).dtype.newbyteorder(order))
            for name, column in columns.items()
        }
        for name, column in arrays.items():
            quoted = name.replace("'", "''")
            code = codes[column.dtype.str[1:]]
            head += text(f"/'{group}'/'{quoted}'", order)
            head += struct.pack(order + "IIIQ", 20, code, 1, len(column) // chunks) + properties(said, order)
        count = len(next(iter(arrays.values()))) // chunks
        for i in range(chunks):
            part = [column[i * count : (i + 1) * count] for column in arrays.values()]
            if interleaved:
                raw[i] = b"".join(piece[k : k + 1].tobytes() for k in range(count) for piece in part)
            else:
                raw[i] = b"".join(piece.tobytes() for piece in part)
        head = head if meta else b""
        flags = (6 if meta else 0) | 8 | (32 if interleaved else 0) | (64 if order == ">" else 0)
        body = head + b"".join(raw)
        return b"TDSm" + struct.pack("<I", flags) + struct.pack(order + "IQQ", 4713, len(body), len(head)) + body

    return segment


@pytest.fixture(scope="session")
def mcap() -> Callable[..., bytes]:
    """An MCAP with topics of encoded messages, written by the makers' library."""
    writer = pytest.importorskip("mcap.writer")

    def build(topics, *, rate=1000.0, encoding="json", schema="frame", compress=True, chunk_size=1 << 20) -> bytes:
        from mcap.writer import CompressionType

        stream = BytesIO()
        packed = CompressionType.ZSTD if compress else CompressionType.NONE
        out = writer.Writer(stream, compression=packed, chunk_size=chunk_size)
        out.start()
        number = out.register_schema(name=schema, encoding="jsonschema", data=b"{}")
        for topic, messages in topics.items():
            channel = out.register_channel(topic=topic, message_encoding=encoding, schema_id=number)
            for i, message in enumerate(messages):
                data = message if isinstance(message, bytes) else json.dumps(message).encode()
                time = 1_700_000_000_000_000_000 + round(i * 1e9 / rate)
                out.add_message(channel, log_time=time + 5_000_000, data=data, publish_time=time)
        out.finish()
        return stream.getvalue()

    return build
