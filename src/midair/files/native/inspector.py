"""Check whether an HDF5 file is safe to read; runs as a separate process.

Some damaged or malicious files crash HDF5, a C library, and with it the program; therefore this process opens an
untrusted file first. It rejects links to other names and files, external or missing data, filters from plugins, named
types, and sizes that exceed the data on the disk.

As a script it imports nothing of midair, so that it starts within 0.1 s. Its input has one JSON path per line, its
output one line of JSON per file, null if the file is safe.
"""

import importlib.util
import json
import math
import re
import signal
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5l, h5o, h5t  # pyright: ignore[reportAttributeAccessIssue]  # compiled

MEMORY = 2**31
"""Memory limit of the process in bytes."""

SECONDS = 1.0
"""CPU time limit per file and per 4 GB, in s; a sound file of 1 GB takes 0.06 s."""

EMPTY = 2**24
"""Bytes of a dataset that may be missing in the file: an interrupted recorder does not write the last ones."""

EXPANDED = 100
"""Maximum ratio of expanded to compressed size; deflate reaches 1000 for constant data."""

EXPANDED_ANYWAY = 2**27
"""Expanded size that is always allowed, in bytes."""

TEXT = 2**26
"""Maximum size of the attributes of an object in bytes."""

OBJECTS = 10_000
"""Maximum number of groups and datasets."""

DEFLATE, SHUFFLE, FLETCHER32 = 1, 2, 3
"""Numbers of the built-in filters that are accepted (HDF5 File Format Specification 3.0, IV.A.2.l)."""


class NotPlainError(Exception):
    """Reason to reject a file, worded to follow "got"."""


def refusal(path: Path, opened: Callable[[Path], Any]) -> str | None:
    """The reason to reject a file, or None; `opened` converts the path to an argument for h5py."""
    try:
        with h5py.File(opened(path), "r", locking=False) as file:
            _walk(file, path.stat().st_size)
    except NotPlainError as wrong:
        return str(wrong)
    except MemoryError:
        raise
    except (Exception, RecursionError) as wrong:  # noqa: BLE001  # h5py raises many types
        lines = str(wrong).strip().splitlines()
        return f"a damaged or foreign file ({_plain_message(lines[0])[:160] if lines else type(wrong).__name__})"
    return None


def _plain_message(words: str) -> str:
    """Error message of HDF5 without the names of its internal variables."""
    if cut := re.search(r"truncated file: eof = (\d+), .*stored_eof = (\d+)", words):
        return f"truncated: {cut[1]} bytes of {cut[2]}"
    inner = re.fullmatch(r"Unable to [a-z ]+\((.*)\)", words)
    return inner[1] if inner else words


def _walk(file: h5py.File, size: int) -> None:
    """Check each object of the file once, whatever the links."""
    seen: set[Any] = set()
    waiting: list[tuple[str, Any]] = [("/", file["/"].id)]
    expanded = 0
    while waiting:
        name, item = waiting.pop()
        place = h5o.get_info(item).addr
        if place in seen:
            continue
        seen.add(place)
        if len(seen) > OBJECTS:
            raise NotPlainError(f"more than {OBJECTS} objects")
        # Looking up a name uses a separate tree, which can crash HDF5 even if the list of names is sound.
        h5a.exists(item, b"kind")
        room = TEXT
        for number in range(h5a.get_num_attrs(item)):
            attribute = h5a.open(item, index=number)
            kind = attribute.get_type()
            room -= math.prod(attribute.shape or ()) * kind.get_size()
            if room < 0:
                raise NotPlainError(f"attributes of {name!r} that take more than {TEXT} bytes")
            if kind.get_class() in (h5t.INTEGER, h5t.FLOAT, h5t.STRING):
                holder = h5py.Group(item) if isinstance(item, h5g.GroupID) else h5py.Dataset(item)
                _ = holder.attrs[attribute.name.decode("utf-8", "replace")]
        if isinstance(item, h5d.DatasetID):
            expanded += _check_numbers(name, item, size)
            if expanded > max(EXPANDED * size, EXPANDED_ANYWAY):
                raise NotPlainError(f"{size} bytes that expand to {expanded}: more than {EXPANDED} times as many")
        elif isinstance(item, h5t.TypeID):
            raise NotPlainError(f"a named type, {name!r}")
        else:
            waiting.extend(_links(name, item))


def _links(name: str, group: Any) -> Iterator[tuple[str, Any]]:
    count = group.get_num_objs()
    if count > OBJECTS:
        raise NotPlainError(f"{count} names in {name!r}")
    kinds = {h5l.TYPE_SOFT: "a soft link", h5l.TYPE_EXTERNAL: "a link to another file"}
    for link in list(group):
        full = f"{name.rstrip('/')}/{link.decode('utf-8', 'replace')}"
        kind = group.links.get_info(link).type
        if kind != h5l.TYPE_HARD:
            raise NotPlainError(f"{kinds.get(kind, 'a link of another program')}, {full!r}; copy its target here")
        yield full, h5o.open(group, link)


def _check_numbers(name: str, item: Any, size: int) -> int:
    """Size of a dataset in memory in bytes, after checking that it is plain and that the file contains its data."""
    made, kind = item.get_create_plist(), item.get_type()
    announced = math.prod(item.shape or ()) * kind.get_size()
    layout = made.get_layout()
    if layout == h5d.COMPACT:
        return announced
    if layout == h5d.CONTIGUOUS:
        if made.get_external_count():
            raise NotPlainError(f"data of {name!r} in another file")
        place = item.get_offset()
        return _checked_size(name, announced, 0 if place is None else max(0, min(announced, size - place)))
    if layout != h5d.CHUNKED:
        raise NotPlainError(f"a virtual dataset, {name!r}, with data elsewhere")
    filters = [made.get_filter(number)[0] for number in range(made.get_nfilters())]
    unknown = [number for number in filters if number not in (DEFLATE, SHUFFLE, FLETCHER32)]
    if unknown or len(set(filters)) < len(filters):
        raise NotPlainError(
            f"filters {filters} of {name!r}; only shuffle, deflate and Fletcher-32 are allowed, once each"
        )
    whole = math.prod(made.get_chunk()) * item.get_type().get_size()
    if whole > max(EXPANDED * size, EXPANDED_ANYWAY):
        raise NotPlainError(f"chunks of {whole} bytes of {name!r} in a file of {size}")
    stored: list[int] = []

    def look(chunk: Any) -> None:
        if chunk.byte_offset is None or chunk.byte_offset + chunk.size > size or chunk.filter_mask:
            raise NotPlainError(f"a chunk of {name!r} beyond the end of the file")
        if DEFLATE in filters:
            _check_deflated(name, item, chunk, filters, whole)
        elif chunk.size != whole + 4 * (FLETCHER32 in filters):
            raise NotPlainError(f"a chunk of {name!r} of {chunk.size} bytes instead of {whole}")
        stored.append(whole)

    item.chunk_iter(look)
    return _checked_size(name, announced, sum(stored))


def _check_deflated(name: str, item: Any, chunk: Any, filters: list[int], whole: int) -> None:
    """Raise unless a chunk expands to the expected size: HDF5 reads beyond the buffer of one that is too short."""
    _, data = item.read_direct_chunk(chunk.chunk_offset)
    # Filters are undone from the last to the first.
    for number in reversed(filters[filters.index(DEFLATE) + 1 :]):
        if number == FLETCHER32:
            if len(data) < 4 or not _has_fletcher32(data):
                return  # HDF5 compares it before it expands the chunk, and reports the damage.
            data = data[:-4]
    expanded = len(zlib.decompressobj().decompress(data, whole + 5))
    if expanded != whole + 4 * (FLETCHER32 in filters[: filters.index(DEFLATE)]):
        raise NotPlainError(f"a chunk of {name!r} that expands to {expanded} bytes instead of {whole}")


def _has_fletcher32(data: bytes) -> bool:
    """True if data end in their checksum (HDF5 File Format Specification 3.0: sums of 16-bit words, modulo 65535)."""
    words = np.frombuffer(data[:-4] + b"\0" * (len(data) % 2), ">u2").astype(np.int64)
    second = int((np.arange(len(words), 0, -1) * words % 65535).sum())
    first, last = map(int, np.frombuffer(data[-4:], "<u2"))
    return (first - int(words.sum())) % 65535 == 0 and (last - second) % 65535 == 0


def _checked_size(name: str, announced: int, stored: int) -> int:
    if announced > stored + EMPTY:
        raise NotPlainError(f"{name!r} of {announced} bytes, of which {stored} are stored")
    return announced


def _limit_resources(size: int) -> None:
    """Limit memory and CPU time of the process for a file of this size, where the system supports it."""
    try:
        import resource
    except ImportError:
        return
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    soft = MEMORY if hard == resource.RLIM_INFINITY else min(MEMORY, hard)
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
    # The signal of the timer ends the process, also within HDF5.
    signal.setitimer(signal.ITIMER_PROF, SECONDS * (1 + size / 2**32))


def main() -> None:
    """Answer for one file after the other until the input is closed."""
    found = importlib.util.spec_from_file_location("hdf5_recovery", Path(__file__).with_name("hdf5_recovery.py"))
    if found is None or found.loader is None:
        return
    recovery = importlib.util.module_from_spec(found)
    found.loader.exec_module(recovery)
    for line in sys.stdin:
        path = Path(json.loads(line))
        _limit_resources(path.stat().st_size)
        answer = refusal(path, recovery.openable)
        print(json.dumps(answer), flush=True)  # noqa: T201  # the answer


if __name__ == "__main__":
    main()
