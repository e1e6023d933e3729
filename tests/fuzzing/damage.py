"""Damage by somebody who knows how each kind of file is built: lengths, counts, types and checksums fit again."""

import copy
import io
import json
import re
import struct
import tomllib
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
import tomli_w

Damage = Callable[[bytes, np.random.Generator], bytes]

WEIRD = (0, 1, 2, 3, 4, 5, 7, 8, 15, 16, 64, 127, 128, 255, 256, 1000, 32767, 65535, 65536, 2**24, 2**31 - 1, 2**31)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2, 10**30, -(10**30), 1e308, -1e308, 1e-320, float("nan"), float("inf"), 0.5),
    *("", "n/a", "=1+1", "[/]", "\x1b[2J", "\0", "x" * 70_000, "ä\u202e", "1", "-1", "nan", [], {}, [[]], [1, "a"]),
    *([0] * 1000, {"a": 1}, {"event": "answer"}, [None], "2026-11-22T00:00:00+00:00", "1e999", [1.5, [2]]),
)


def bytes_anywhere(data: bytes, rng: np.random.Generator) -> bytes:
    """Bytes or bits changed, left out, doubled, or the end cut."""
    spoilt = bytearray(data)
    first, last = sorted(int(i) for i in rng.integers(len(data), size=2))
    match int(rng.integers(5)):
        case 0:
            del spoilt[first:]
        case 1:
            for place in rng.integers(len(data), size=rng.integers(1, 9)):
                spoilt[place] = rng.integers(256)
        case 2:
            for place in rng.integers(len(data), size=rng.integers(1, 4)):
                spoilt[place] ^= 1 << int(rng.integers(8))
        case 3:
            del spoilt[first : min(last, first + 64)]
        case _:
            spoilt[first:last] = spoilt[first:last] * 2
    return bytes(spoilt)


def number_at(spoilt: bytearray, place: int, size: int, rng: np.random.Generator, order: str = "<") -> None:
    """A number that somebody may have written there: at the edges of what it can be, or near what it was."""
    if not 0 <= place <= len(spoilt) - size:
        return
    have = int.from_bytes(spoilt[place : place + size], "little" if order == "<" else "big")
    near = (have + 1, have - 1, have * 2, have // 2, have ^ (1 << int(rng.integers(8 * size))), have << 16)
    edges = (*WEIRD, 2 ** (8 * size) - 1, 2 ** (8 * size - 1), 2 ** (8 * size) - 8, 2**40, 2**62)
    value = int(rng.choice(np.array([*near, *edges], object))) % 2 ** (8 * size)
    spoilt[place : place + size] = value.to_bytes(size, "little" if order == "<" else "big")


def fields(*patterns: tuple[bytes, tuple[tuple[int, int], ...]], order: str = "<") -> Damage:
    """Numbers at these distances (and of these sizes) behind each place where the bytes match a pattern."""

    def damage(data: bytes, rng: np.random.Generator) -> bytes:
        spoilt = bytearray(data)
        places = [
            (found.start() + offset, size)
            for pattern, numbers in patterns
            for found in re.finditer(pattern, data, re.DOTALL)
            for offset, size in numbers
        ]
        for index in rng.integers(len(places), size=rng.integers(1, 4)) if places else ():
            number_at(spoilt, *places[index], rng, order)
        return bytes(spoilt)

    return damage


RIFF = fields(
    (rb"RIFF|RF64", ((4, 4),)),
    (rb"fmt ", ((4, 4), (8, 2), (10, 2), (12, 4), (16, 4), (20, 2), (22, 2), (24, 2), (26, 2), (28, 4), (32, 2))),
    (rb"data|mdar|fact|PEAK", ((4, 4), (8, 4))),
    (rb"ds64", ((4, 4), (8, 8), (16, 8), (24, 8), (32, 4))),
)
WAVE64 = fields(
    (rb"riff\x2e|fmt \xf3|data\xf3|fact\xf3", ((16, 8),)),
    (rb"fmt \xf3", ((24, 2), (26, 2), (28, 4), (32, 4), (36, 2), (38, 2), (40, 2))),
)
TDMS = fields(
    (rb"TDSm", ((4, 4), (8, 4), (12, 8), (20, 8), (28, 4))),
    (rb"/'skin'(?:/'mic .')?", ((-4, 4), (7, 4), (11, 4), (15, 4), (19, 4), (23, 4), (27, 8), (35, 4), (39, 4))),
    (rb"wf_increment", ((-4, 4), (12, 4), (16, 8))),
    (rb"unit_string", ((-4, 4), (11, 4), (15, 4))),
)


def xdf(data: bytes, rng: np.random.Generator) -> bytes:
    """Lengths of chunks and counts of samples; words of the XML, the length repaired."""
    if rng.random() < 0.5:
        numbers = ((0, 1), (1, 4), (5, 2), (7, 4), (11, 1), (12, 4), (16, 1), (17, 8))
        return fields((rb"\x04....[\x01-\x06]\x00", numbers))(data, rng)
    swaps = (
        (b"float32", (b"string", b"int8", b"double64", b"int64", b"x")),
        (b">6<", (b">0<", b">-1<", b">9999999<", b">7<")),
    )
    swaps += ((b"1000<", (b"0<", b"-1<", b"nan<", b"1e308<", b"x<")), (b"<name>", (b"<nam>", b"<name><a/>")))
    swaps += (
        (b"<desc>", (b"<desc>" * 500, b"<desc>&a;", b"<!-- ", b"<desc><desc/>")),
        (b"volts", (b"", b"kPa", b"[/]")),
    )
    old, new = swaps[int(rng.integers(len(swaps)))]
    return with_chunk_replaced(data, old, new[int(rng.integers(len(new)))])


def with_chunk_replaced(data: bytes, old: bytes, new: bytes) -> bytes:
    """An XDF whose header of the stream says something else."""
    place = 4
    while place + 7 <= len(data):
        length = struct.unpack_from("<I", data, place + 1)[0]
        content = data[place + 7 : place + 5 + length]
        if data[place + 5] == 2:
            changed = content.replace(old, new)
            head = b"\x04" + struct.pack("<IH", len(changed) + 2, 2)
            return data[:place] + head + changed + data[place + 5 + length :]
        place += 5 + length
    return data


def npz(data: bytes, rng: np.random.Generator) -> bytes:
    """Headers of the arrays, and the archive's own numbers."""
    if rng.random() < 0.4:
        local = (rb"PK\x03\x04", tuple((i, 2) for i in range(4, 30, 2)))
        central = (rb"PK\x01\x02", tuple((i, 2) for i in range(4, 46, 2)))
        return fields(local, central, (rb"PK\x05\x06", tuple((i, 2) for i in range(4, 22, 2))))(data, rng)
    swaps = (
        *((b"(40, ", new) for new in (b"(99999999999, ", b"(0, ", b"(-1, ", b"(40.5, ", b"(40, 2, 3, ", b"(True, ")),
        *((b"<f8", new) for new in (b"|O", b"<c16", b"|V8", b"<U9", b"<M8", b"<f2", b">f8", b"|S8", b"(2,)f8")),
        *((b"False", new) for new in (b"True", b"None", b"1")),
        *((b"{'descr'", new) for new in (b"{'desc'", b"{" * 300, b"__import__('os')", b"{'a': 1, 'descr'")),
    )
    old, new = swaps[int(rng.integers(len(swaps)))]
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as archive, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as made:
        for name in archive.namelist():
            content = archive.read(name)
            if rng.random() < 0.5:
                content = _npy_with(content, old, new)
            if rng.random() < 0.02:
                content += b"\0" * 2**25
            made.writestr(name if rng.random() < 0.9 else f"../{name}", content)
    return out.getvalue()


def _npy_with(content: bytes, old: bytes, new: bytes) -> bytes:
    """An array whose header says something else, its length repaired."""
    length = struct.unpack_from("<H", content, 8)[0]
    header = content[10 : 10 + length].replace(old, new)
    return content[:8] + struct.pack("<H", len(header) % 65536) + header + content[10 + length :]


def table(data: bytes, rng: np.random.Generator) -> bytes:
    """Fields, rows and names of a text table; midair's own first line as JSON."""
    text = data.decode("utf-8", "replace")
    if text.startswith("# midair ") and rng.random() < 0.5:
        first, _, rest = text.partition("\n")
        header = json.loads(first.removeprefix("# midair "))
        return f"# midair {json.dumps(tree(header, rng))}\n{rest}".encode("utf-8", "replace")
    lines = text.split("\n")
    for _ in range(int(rng.integers(1, 4))):
        row = int(rng.integers(len(lines)))
        mark = "\t" if "\t" in lines[row] else ","
        words = lines[row].split(mark)
        column = int(rng.integers(len(words)))
        match int(rng.integers(7)):
            case 0:
                words.pop(column)
            case 1:
                words.insert(column, str(VALUES[int(rng.integers(len(VALUES)))]))
            case 2:
                lines.insert(row, lines[row])
            case 3:
                words = words * int(rng.choice([2, 50]))
            case 4:
                words[column] = '"' + words[column]
            case _:
                new = (
                    "nan",
                    "inf",
                    "1e400",
                    "",
                    "1e9",
                    "-1e9",
                    "n/a",
                    "=1",
                    "0x10",
                    "1_000",
                    "١",
                    "true",
                    "1e17",
                    "\0",
                    "\r",
                )
                words[column] = new[int(rng.integers(len(new)))]
        lines[row] = mark.join(words)
    return "\n".join(lines).encode("utf-8", "replace")


def tree(value: Any, rng: np.random.Generator, *, values: tuple[Any, ...] = VALUES) -> Any:
    """JSON with up to three values replaced, left out, renamed, or buried."""
    value = copy.deepcopy(value)
    for _ in range(int(rng.integers(1, 4))):
        holders = _holders(value)
        if not holders:
            return values[int(rng.integers(len(values)))]
        holder = holders[int(rng.integers(len(holders)))]
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        key = keys[int(rng.integers(len(keys)))]
        match int(rng.integers(6)):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, dict):
                holder[f"{key}x"] = holder.pop(key)
            case 2 if isinstance(holder, list):
                holder.extend(holder[:100])
            case 3:
                holder[key] = [holder[key]]
            case _:
                holder[key] = copy.deepcopy(values[int(rng.integers(len(values)))])
    return value


def _holders(value: Any) -> list[Any]:
    found, waiting = [], [value]
    while waiting and len(found) < 3000:
        one = waiting.pop()
        if isinstance(one, dict | list) and one:
            found.append(one)
            waiting.extend(one.values() if isinstance(one, dict) else one)
    return found


def json_text(data: bytes, rng: np.random.Generator) -> bytes:
    if rng.random() < 0.03:
        return b'{"a":' * 100_000
    if rng.random() < 0.05:
        return b"[" * 100_000
    return json.dumps(tree(json.loads(data), rng), ensure_ascii=bool(rng.random() < 0.5)).encode("utf-8", "replace")


def json_lines(data: bytes, rng: np.random.Generator) -> bytes:
    """A log of JSON: lines changed, left out, doubled, moved."""
    lines = data.split(b"\n")
    for _ in range(int(rng.integers(1, 4))):
        row = int(rng.integers(len(lines)))
        match int(rng.integers(5)):
            case 0:
                lines.pop(row)
            case 1:
                lines.insert(int(rng.integers(len(lines))), lines[row])
            case _ if lines[row]:
                lines[row] = json_text(lines[row], rng)
        lines = lines or [b""]
    return b"\n".join(lines)


def toml_text(data: bytes, rng: np.random.Generator) -> bytes:
    """A TOML document, one in another encoding, or one whose brackets or keys go deep."""
    chance = rng.random()
    if chance < 0.03:
        return data + b"\nz = " + b"[" * 100_000
    if chance < 0.05:
        return data + b"\n[z" + b".z" * 50_000 + b"]\n"
    if chance < 0.08:
        return data.decode().encode("utf-16")
    values = tuple(
        value for value in VALUES if value is not None and abs(value if isinstance(value, int) else 0) < 2**63
    )
    try:
        return tomli_w.dumps(tree(tomllib.loads(data.decode()), rng, values=values)).encode("utf-8", "replace")
    except (AttributeError, TypeError, ValueError):  # of what TOML cannot write
        return data


DAMAGES: dict[str, Damage] = {
    ".wav": RIFF,
    ".rf64": RIFF,
    ".w64": WAVE64,
    ".npz": npz,
    ".tdms": TDMS,
    ".xdf": xdf,
    ".csv": table,
    ".tsv": table,
    ".jsonl": json_lines,
    ".json": json_text,
    ".ahap": json_text,
    ".haptic": json_text,
    ".toml": toml_text,
}
"""By the end of a name, the longest first."""


def damaged(name: str, data: bytes, rng: np.random.Generator) -> bytes:
    """A file of that name, damaged; one in six with no respect for its structure."""
    if not data or rng.random() < 1 / 6:
        return bytes_anywhere(data or b"\0", rng)
    for ending in sorted(DAMAGES, key=len, reverse=True):
        if name.endswith(ending):
            try:
                return DAMAGES[ending](data, rng)
            except Exception:  # noqa: BLE001  # what was changed no longer lets itself be packed
                return bytes_anywhere(data, rng)
    return bytes_anywhere(data, rng)
