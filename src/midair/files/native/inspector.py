"""What an HDF5 file makes HDF5 do, looked at before anybody reads its numbers; runs as a process of its own.

HDF5 is a library in C, and a file can make it fail in ways that end the program; so the first one to open a file of
strangers is this process, which may die of it. It refuses what is not plain: links to other names and files, numbers
that lie elsewhere or nowhere, filters of plugins, types with a name, and sizes that the bytes on the disk cannot hold.

Run as a script it imports nothing of midair, so that it is there in a tenth of a second: a name a line comes in, a line
of JSON goes out, null when there is nothing to refuse.
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
from h5py import h5a, h5d, h5g, h5l, h5o, h5t  # pyright: ignore[reportAttributeAccessIssue]  # compiled

MEMORY = 2**31
"""Bytes that the process may take."""

SECONDS = 1.0
"""Of processor time that one file may take, and again for every 4 GB: a sound one of 1 GB takes 0.06."""

EMPTY = 2**24
"""Bytes that a dataset may have beyond what is stored of it: a recorder that was killed leaves the last ones out."""

EXPANDED = 100
"""Times its size that a file may expand to, as deflate makes 1000 of 1 of what is always the same."""

EXPANDED_ANYWAY = 2**27
"""Bytes that any file may expand to."""

TEXT = 2**26
"""Bytes that the attributes of an object may take."""

OBJECTS = 10_000
"""Most groups and datasets."""

DEFLATE, SHUFFLE, FLETCHER32 = 1, 2, 3
"""Numbers of the filters that HDF5 brings along and that are read (HDF5 File Format Specification 3.0, IV.A.2.l)."""


class NotPlainError(Exception):
    """What of a file is refused, in words that stand after "got"."""


def refusal(path: Path, opened: Callable[[Path], Any]) -> str | None:
    """What makes a file one that must not be read; None if nothing does.

    Parameters
    ----------
    path : Path
        The file.
    opened : callable
        Makes of the path what h5py opens: itself, or its bytes if it was not closed.
    """
    try:
        with h5py.File(opened(path), "r", locking=False) as file:
            _walk(file, path.stat().st_size)
    except NotPlainError as wrong:
        return str(wrong)
    except (Exception, RecursionError) as wrong:  # noqa: BLE001  # h5py raises whatever HDF5 stumbles over
        lines = str(wrong).strip().splitlines()
        return f"a damaged or foreign file ({_plainly(lines[0])[:160] if lines else type(wrong).__name__})"
    return None


def _plainly(words: str) -> str:
    """What HDF5 says of a file, without the names of its own variables."""
    if cut := re.search(r"truncated file: eof = (\d+), .*stored_eof = (\d+)", words):
        return f"truncated: {cut[1]} bytes of {cut[2]}"
    inner = re.fullmatch(r"Unable to [a-z ]+\((.*)\)", words)
    return inner[1] if inner else words


def _walk(file: h5py.File, size: int) -> None:
    """Look at everything in the file once, however it is linked."""
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
        _look_at_attributes(name, item)
        if isinstance(item, h5d.DatasetID):
            expanded += _look_at_numbers(name, item, size)
            if expanded > max(EXPANDED * size, EXPANDED_ANYWAY):
                raise NotPlainError(f"{size} bytes that expand to {expanded}: more than {EXPANDED} times as many")
        elif isinstance(item, h5t.TypeID):
            raise NotPlainError(f"a type with a name, {name!r}")
        else:
            waiting.extend(_linked(name, item))


def _linked(name: str, group: Any) -> Iterator[tuple[str, Any]]:
    count = group.get_num_objs()
    if count > OBJECTS:
        raise NotPlainError(f"{count} names in {name!r}")
    kinds = {h5l.TYPE_SOFT: "a soft link", h5l.TYPE_EXTERNAL: "a link to another file"}
    for link in list(group):
        full = f"{name.rstrip('/')}/{link.decode('utf-8', 'replace')}"
        kind = group.links.get_info(link).type
        if kind != h5l.TYPE_HARD:
            raise NotPlainError(f"{kinds.get(kind, 'a link of another program')}, {full!r}; copy what it means into it")
        yield full, h5o.open(group, link)


def _look_at_attributes(name: str, item: Any) -> None:
    """Read what is text or numbers; lists of references, as of netCDF's axes, are left alone by everybody."""
    # Names are looked up in a tree of their own, which may end HDF5 where a list of them is short and sound.
    h5a.exists(item, b"kind")
    room = TEXT
    for number in range(h5a.get_num_attrs(item)):
        attribute = h5a.open(item, index=number)
        kind = attribute.get_type()
        room -= math.prod(attribute.shape or ()) * kind.get_size()
        if room < 0:
            raise NotPlainError(f"attributes of {name!r} of more than {TEXT} bytes")
        if kind.get_class() in (h5t.INTEGER, h5t.FLOAT, h5t.STRING):
            holder = h5py.Group(item) if isinstance(item, h5g.GroupID) else h5py.Dataset(item)
            _ = holder.attrs[attribute.name.decode("utf-8", "replace")]


def _look_at_numbers(name: str, item: Any, size: int) -> int:
    """Bytes that a dataset takes in memory, once it is plain and the file holds what it announces."""
    made, kind = item.get_create_plist(), item.get_type()
    announced = math.prod(item.shape or ()) * kind.get_size()
    layout = made.get_layout()
    if layout == h5d.COMPACT:
        return announced
    if layout == h5d.CONTIGUOUS:
        if made.get_external_count():
            raise NotPlainError(f"numbers of {name!r} that lie in another file")
        place = item.get_offset()
        stored = 0 if place is None else max(0, min(announced, size - place))
        return _fitting(name, announced, stored)
    if layout != h5d.CHUNKED:
        raise NotPlainError(f"a virtual dataset, {name!r}, whose numbers lie elsewhere")
    return _look_at_chunks(name, item, made, announced, size)


def _look_at_chunks(name: str, item: Any, made: Any, announced: int, size: int) -> int:
    filters = [made.get_filter(number)[0] for number in range(made.get_nfilters())]
    unknown = [number for number in filters if number not in (DEFLATE, SHUFFLE, FLETCHER32)]
    if unknown or len(set(filters)) < len(filters):
        raise NotPlainError(f"filters {filters} of {name!r}; only shuffle, deflate and Fletcher-32 are read, once each")
    whole = math.prod(made.get_chunk()) * item.get_type().get_size()
    if whole > max(EXPANDED * size, EXPANDED_ANYWAY):
        raise NotPlainError(f"pieces of {whole} bytes of {name!r} in a file of {size}")
    stored: list[int] = []

    def look(chunk: Any) -> None:
        if chunk.byte_offset is None or chunk.byte_offset + chunk.size > size or chunk.filter_mask:
            raise NotPlainError(f"a piece of {name!r} beyond the end")
        if DEFLATE in filters:
            _check_deflated(name, item, chunk, filters, whole)
        elif chunk.size != whole + 4 * (FLETCHER32 in filters):
            raise NotPlainError(f"a piece of {name!r} of {chunk.size} bytes instead of {whole}")
        stored.append(whole)

    item.chunk_iter(look)
    return _fitting(name, announced, sum(stored))


def _check_deflated(name: str, item: Any, chunk: Any, filters: list[int], whole: int) -> None:
    """Raise unless the piece expands to what is expected: HDF5 itself reads on beyond one that is short."""
    _, data = item.read_direct_chunk(chunk.chunk_offset)
    # Filters are undone from the last to the first.
    for number in reversed(filters[filters.index(DEFLATE) + 1 :]):
        data = data[:-4] if number == FLETCHER32 else data
    expanded = len(zlib.decompressobj().decompress(data, whole + 5))
    if expanded != whole + 4 * (FLETCHER32 in filters[: filters.index(DEFLATE)]):
        raise NotPlainError(f"a piece of {name!r} that expands to {expanded} bytes instead of {whole}")


def _fitting(name: str, announced: int, stored: int) -> int:
    if announced > stored + EMPTY:
        raise NotPlainError(f"{name!r} of {announced} bytes, of which {stored} are stored")
    return announced


def _limited(size: int) -> None:
    """Take no more memory and time than a sound file of so many bytes needs, where the system can limit it."""
    try:
        import resource
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
    # Its signal ends the process, also inside of HDF5.
    signal.setitimer(signal.ITIMER_PROF, SECONDS * (1 + size / 2**32))


def main() -> None:
    """Answer for one file after the other until nobody asks any more."""
    found = importlib.util.spec_from_file_location("hdf5_recovery", Path(__file__).with_name("hdf5_recovery.py"))
    if found is None or found.loader is None:
        return
    recovery = importlib.util.module_from_spec(found)
    found.loader.exec_module(recovery)
    for line in sys.stdin:
        path = Path(json.loads(line))
        _limited(path.stat().st_size)
        answer = refusal(path, recovery.openable)
        print(json.dumps(answer), flush=True)  # noqa: T201  # the answer


if __name__ == "__main__":
    main()
