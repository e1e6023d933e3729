"""Files of other programs, by the specifications of their formats."""

import struct

import numpy as np


def _xdf_chunk(tag: int, content: bytes) -> bytes:
    return b"\x04" + struct.pack("<IH", len(content) + 2, tag) + content


def xdf(
    samples, *, rate=1000.0, stamps=None, labels=(), unit="", name="skin", number=1, start=100.0, clocks=True
) -> bytes:
    """A stream of an XDF file by its specification (sccn/xdf, 1.0): header, samples, clock offsets, footer."""
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
    clock = b"".join(_xdf_chunk(4, stream + struct.pack("<dd", start + i, 0.0)) for i in range(3 * clocks))
    return (
        _xdf_chunk(2, stream + head.encode())
        + _xdf_chunk(3, stream + b"\x04" + struct.pack("<I", len(samples)) + rows)
        + clock
        + _xdf_chunk(6, stream + b"<info><sample_count>1</sample_count></info>")
    )


def xdf_whole(*streams: bytes) -> bytes:
    return b"XDF:" + _xdf_chunk(1, b"<?xml version='1.0'?><info><version>1.0</version></info>") + b"".join(streams)


def _tdms_text(value: str, order: str) -> bytes:
    return struct.pack(order + "I", len(value.encode())) + value.encode()


def _tdms_properties(values: dict, order: str) -> bytes:
    parts = [struct.pack(order + "I", len(values))]
    for key, value in values.items():
        if isinstance(value, str):
            parts.append(_tdms_text(key, order) + struct.pack(order + "I", 0x20) + _tdms_text(value, order))
        else:
            kind = (7, "I") if isinstance(value, int) else (10, "d")
            parts.append(_tdms_text(key, order) + struct.pack(f"{order}I{kind[1]}", kind[0], value))
    return b"".join(parts)


def tdms(columns, *, order="<", interleaved=False, chunks=1, group="skin", said=None, each=None, meta=True) -> bytes:
    """A TDMS segment as described by National Instruments, of arrays by channel, cut into `chunks` chunks.

    `said` are the properties of all channels, `each` those of some by name.
    """
    said = {"wf_increment": 1e-3, "unit_string": "V"} if said is None else said
    codes = {"i2": 2, "i4": 3, "u1": 5, "f4": 9, "f8": 10}
    head = struct.pack(order + "I", len(columns) + 1)
    head += _tdms_text(f"/'{group}'", order) + struct.pack(order + "II", 0xFFFFFFFF, 0)
    raw = [b""] * chunks
    arrays = {
        name: np.asarray(column).astype(np.asarray(column).dtype.newbyteorder(order))
        for name, column in columns.items()
    }
    for name, column in arrays.items():
        quoted = name.replace("'", "''")
        code = codes[column.dtype.str[1:]]
        head += _tdms_text(f"/'{group}'/'{quoted}'", order)
        head += struct.pack(order + "IIIQ", 20, code, 1, len(column) // chunks)
        head += _tdms_properties((each or {}).get(name, said), order)
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


def daqmx(rows: bytes, offsets, said, *, frames, width) -> bytes:
    """A TDMS segment of DAQmx raw data: rows of `width` bytes, in which each channel is an int16 at its offset."""
    head = struct.pack("<I", len(offsets) + 1) + _tdms_text("/'skin'", "<") + struct.pack("<II", 0xFFFFFFFF, 0)
    for name, offset in offsets.items():
        head += _tdms_text(f"/'skin'/'{name}'", "<") + struct.pack("<IIIQI", 0x1269, 0xFFFFFFFF, 1, frames, 1)
        head += struct.pack("<IIIII", 3, 0, offset, 0, 0) + struct.pack("<II", 1, width) + _tdms_properties(said, "<")
    return b"TDSm" + struct.pack("<IIQQ", 0x8E, 4713, len(head) + len(rows), len(head)) + head + rows
