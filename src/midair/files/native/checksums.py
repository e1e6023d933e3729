"""Checksums of stored rows: which rows of a dataset are damaged.

A dataset that is written at once has a checksum of HDF5 (Fletcher-32) in each chunk. One that grows has the CRC-32 of
each 256 rows in the group `checksums` beside it, because a writer that is killed within a chunk would leave a chunk
with a wrong checksum of HDF5.
"""

import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import h5py

ROWS = 256
"""Number of rows that share a CRC-32."""

GROUP = "checksums"

_ROWS = {"time": "frames", "row": "rows", "frequency": "frequencies", "transducer": "transducers"}

Ranges = Sequence[tuple[int, int]]
"""First row and the row after the last, of each range."""


def create_checksums(dataset: "h5py.Dataset") -> None:
    """Create the checksums of a dataset that grows, none so far."""
    group: Any = dataset.parent
    beside = group.require_group(GROUP)
    beside.create_dataset(_name(dataset), shape=(0,), maxshape=(None,), chunks=(1024,), dtype="u4")


def extend_checksums(dataset: "h5py.Dataset", rows: int, *, last: bool = False) -> None:
    """Add the checksums of all whole blocks of the first `rows` rows, and with `last` of the rest."""
    stored: Any = _stored(dataset)
    known, blocks = min(len(stored), rows // ROWS), -(-rows // ROWS) if last else rows // ROWS
    # After a disk error, rows were removed: the last checksum can be of more rows.
    if len(stored) != blocks or known < blocks:
        stored.resize(blocks, axis=0)
        stored[known:] = [_crc(dataset[first * ROWS : min(rows, (first + 1) * ROWS)]) for first in range(known, blocks)]


def has_checksums(dataset: "h5py.Dataset") -> bool:
    """True if a flipped bit of the dataset can be detected."""
    return bool(dataset.fletcher32) or _stored(dataset) is not None


def read_rows(dataset: "h5py.Dataset", first: int, last: int, *, closed: bool) -> tuple[np.ndarray, Ranges]:
    """Rows of a dataset and the damaged ones among them, which are NaN or 0."""
    # On a full disk, the CRC-32 of a file that is not closed can be of rows that were not written.
    stored = _stored(dataset) if closed else None
    if stored is None:
        return _read_chunks(dataset, first, last)
    begin, end = first // ROWS * ROWS, min(-(-last // ROWS) * ROWS, len(dataset))
    rows = dataset[begin:end]
    damaged: list[tuple[int, int]] = []
    for number, crc in enumerate(stored[begin // ROWS : -(-end // ROWS)]):
        block = rows[number * ROWS : (number + 1) * ROWS]
        if _crc(block) != crc:
            block[...] = _nothing(block.dtype)
            place = begin + number * ROWS
            damaged.append((max(first, place), min(last, place + len(block))))
    return rows[first - begin : last - begin], damaged


def _read_chunks(dataset: "h5py.Dataset", first: int, last: int) -> tuple[np.ndarray, Ranges]:
    try:
        return dataset[first:last], ()
    except OSError as wrong:
        if wrong.errno or not dataset.chunks:
            raise
        rows = np.full((last - first, *dataset.shape[1:]), _nothing(dataset.dtype), dataset.dtype)
        damaged: list[tuple[int, int]] = []
        size = dataset.chunks[0]
        for place in range(first // size * size, last, size):
            some = max(first, place), min(last, place + size)
            try:
                rows[some[0] - first : some[1] - first] = dataset[slice(*some)]
            except OSError:
                damaged.append(some)
        return rows, damaged


def damage_text(dataset: "h5py.Dataset", axes: Sequence[str], damaged: Ranges) -> str:
    """Name, rows and channels of damaged data."""
    channels = "channels" if tuple(axes[1:]) == ("row", "column") else " x ".join(f"{axis}s" for axis in axes[1:])
    every = f" of all {int(np.prod(dataset.shape[1:]))} {channels}" if channels else ""
    rows = ranges_text(damaged, _ROWS.get(axes[0], axes[0]))
    return f"{_name(dataset)}: {rows}{every} are damaged, their checksum does not match"


def ranges_text(ranges: Ranges, rows: str = "frames") -> str:
    """Ranges of rows in words, the first five."""
    joined: list[tuple[int, int]] = []
    for first, last in ranges:
        begin = joined.pop()[0] if joined and joined[-1][1] == first else first
        joined.append((begin, last))
    more = f" and {len(joined) - 5} more ranges" if len(joined) > 5 else ""
    return f"{rows} " + ", ".join(f"{first} to {last - 1}" for first, last in joined[:5]) + more


def _name(dataset: "h5py.Dataset") -> str:
    return str(dataset.name).rsplit("/", 1)[1]


def _stored(dataset: "h5py.Dataset") -> Any:
    """Checksums of a dataset that grows; None without any, as in files of early versions."""
    group: Any = dataset.parent
    return group.get(f"{GROUP}/{_name(dataset)}")


def _crc(block: np.ndarray) -> int:
    return zlib.crc32(block.tobytes())


def _nothing(kind: np.dtype) -> float:
    return np.nan if kind.kind == "f" else 0
