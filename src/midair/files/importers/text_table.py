"""Tables of numbers in text: one reader for CSV, TSV, LabVIEW's .lvm, and lines of a serial monitor or plotter.

The reader finds in the lines what a file does not state: encoding, separator, sign of decimals, lines before the
numbers, names, a row of units, times of day, counters, notes beside the numbers, and marks of an overflow. Where two
readings fit, the file is refused, and the error names the option that decides.
"""

import codecs
import csv
import re
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from midair.array_types import Array
from midair.errors import BrokenFileError, InputError, NonFiniteError
from midair.files.opened_take import Decimal, ImportedData, ImportOptions
from midair.model import known_unit
from midair.progress import report_progress
from midair.recordings import is_clock
from midair.validation import is_number

SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "space": " "}
"""Separators by name, in the order of preference; several spaces are one."""

_ONE_COLUMN = "\x1f"
_COMMENTS = ("#", "%", "//", "; ")
WORDS: Mapping[str, Any] = tomllib.loads(Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))
"""Marks, names and units of other programs, in small letters."""

_MARKS = frozenset(WORDS["marks"])

_SCPI = (9.9e37, -9.9e37, 9.91e37)  # infinity and NaN of instruments (SCPI 1999, volume 1, 7.2.1)
_TIME = re.compile(
    r"(?P<date>\d{1,4}[-/.](?:\d{1,2}|[A-Z]{3})[-/.]\d{2,4})?(?:T|\s+)?"
    r"(?:(?:(?P<h>\d+):)?(?P<m>\d{1,2}):(?P<s>\d\d(?:[.,]\d+)?)(?::(?P<ms>\d{3}))?\s*(?P<half>[AP]M)?)?"
    r"\s*(?:Z|UTC|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
_MONITOR = re.compile(r"\[?(?:[\d-]{10} )?(\d\d:\d\d:\d\d[.,]\d+)(?:\]| ->) ")
"""Time of a line of a serial monitor: ``12:34:56.789 -> `` of Arduino, ``[2025-05-01 12:34:56.789] `` of Tera Term."""
_LABEL = re.compile(r"([A-Za-z_][\w .]*)[:=]\s*([^\s:=]+)")
_UNIT = re.compile(r"[\[({<]\s*(?![\dxyzXYZ]?\s*[\])}>])([^\[\](){}<>]*?)\s*[\])}>]\s*$|\bin (\S{1,5})$")
"""A unit in brackets, or after "in", at the end of a name; a digit or an axis is none."""
_SUFFIX = re.compile(r"(?:^|[/_, ])([a-zA-Zµ]?(?:V|Pa))$")
"""A unit of voltage or pressure at the end of a name."""
_STATED = r"(?:\s*[\[(](?:hz|s)[\])])?[ \t\"':=,;]+((?>\d[\d.]*(?:e[+-]?\d+)?))(?!,?\d)"
_FACTOR = r"(?:[ \t]*([kmgunµ])?(?:hz|sa?/s|sps|s)\b|(?![ \t]*[a-zµ]))"
_RATE = re.compile(
    r"(?i)\b(?:fs|(?:samples?|sampled|sampling)[ _-]?(?:rate|freq\w*)|(?:frame|update)[ _-]?rate)" + _STATED + _FACTOR
)
_STEP = re.compile(
    r"(?i)\b(?:(?:samples?|sampled|sampling) (?:interval|period)|delta_x|increment|time interval|interval(?==))"
    + _STATED
    + _FACTOR
)
_GROUPS = re.compile(r"(?<=\d)['\u2019\xa0\u202f](?=\d{3}(?!\d))")
"""Apostrophe or narrow space between thousands."""
_PER_SAMPLE = re.compile(r"(?im)^(\d[\d.]*) ([mu]?)sec/sample\b")
_VERTICAL = re.compile(r"\bvertical units?[ ,:]+(\S+)", re.IGNORECASE)


class _Row(NamedTuple):
    line: int
    fields: list[str]


def decoded(data: bytes) -> tuple[str, str]:
    """Text of a file and the name of its encoding: UTF-8, UTF-16, or Windows-1252 for bytes that are neither."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16"), "UTF-16"
    start = data[:400]
    for name, zeros in (("utf-16-le", start[1::2].count(0)), ("utf-16-be", start[::2].count(0))):
        if zeros == start.count(0) > len(start) / 4:
            return data.decode(name), "UTF-16"
    try:
        return data.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        return data.decode("cp1252"), "Windows-1252"


def read_table(text: str, given: ImportOptions | None = None, *, encoding: str = "UTF-8") -> ImportedData:
    """Read the numbers of a text, shape (row, column), with names and units of their columns, stamps and rate.

    Stamps come from times of day, a counter at the stated rate, or a first column without a name.
    With mending, fields that are empty, NaN, infinite or marked as overflow become NaN; otherwise they raise
    NonFiniteError. Raises BrokenFileError if the text has no such table, and InputError if two readings of it fit.
    """
    given = given or ImportOptions()
    lines, comments, separator = _lines(text, given)
    sample = [line for _, line in lines[len(lines) // 2 :]]
    separator = separator or _separator(sample[:: 1 + len(sample) // 200], given)
    rows = _rows(lines, separator)
    decimal = given.decimal or _decimal(rows)
    columns, start = _place(rows)
    head, body = rows[:start], rows[start:]
    if not body:
        raise BrokenFileError("expected rows of numbers, got none")
    names, units, unit_line = _names(head, columns, given, body[0].line)
    names = names or next((found for note in comments[-1:] if (found := _row_of_names(note, separator, columns))), ())
    if not names and all(map(_LABEL.fullmatch, body[0].fields)):
        names, body = _labelled(body)
    _check_widths(body, columns[-1] + 1)
    rate, unit = _facts(comments, head, body, columns, decimal)
    if any(_PER_SAMPLE.match(row.fields[0]) for row in head) and str(len(body) - 1) in body[0].fields:
        body = body[1:]  # AcqKnowledge counts the rows in the first of them
    named = list(names) or [""] * len(columns)
    ends = (_UNIT, _SUFFIX) if given.unit_row is None else (_UNIT,)
    found = [next(filter(None, (end.search(name) for end in ends)), None) for name in named]
    own = [unit if one is None else next(filter(None, one.groups()), "") for one in found]
    units = units or own
    for name, one, two in zip(named, own, units, strict=True) if given.unit_row is None else ():
        if known_unit(one)[0] and known_unit(two)[0] and known_unit(one) != known_unit(two):
            raise InputError(f"expected one unit of column {name!r}, got {two} in line {unit_line}")
    kept, stamps, left = _converted(body, columns, named, decimal, gaps=given.mending is not None)
    if skipped := [str(i + 1) for i in range(columns[-1]) if i not in columns]:
        left.append(f"without numbers in the second half of the rows, and left out: {', '.join(skipped)}")
    if len(kept) > 1:
        first, values = next(iter(kept.items()))
        timed = stamps is not None or any(map(is_clock, names)) or is_clock(f"t [{units[first]}]")
        counts = named[first].lower() in WORDS["counters"] or units[first].lower() == "sequence"
        if not (timed or named[first]) and rate and abs(_even_step(values) * rate - 1) < 0.01:
            stamps = kept.pop(first)
            left.append("the first one is the time in s")
        elif counts and given.time is None and (counted := _counted(values)) is not None:
            del kept[first]
            left.append("the first one counts the rows")
            if not timed and (every := rate or given.rate):
                stamps = counted / every
    if not kept:
        raise BrokenFileError("expected rows of numbers, got none")
    if not (names or rate) and (rate := _below_a_date(kept)):
        kept = {i: each[2:] for i, each in kept.items()}
        left.append("the first two rows hold the date and the rate")
    for i, each in kept.items():
        if not is_clock(named[i]) and not is_clock(f"t [{units[i]}]") and _even_step(each):
            left.append(f"{_column(i, columns, named)} increases evenly, as a time or a counter does (--time)")
    spelled = next((name for name, sign in SEPARATORS.items() if sign == separator), repr(separator))
    said = [encoding, "one column" if separator == _ONE_COLUMN else f"separator {spelled}", f"decimal {decimal}"]
    said += [f"numbers from line {body[0].line} on", *([f"units in line {unit_line}"] if unit_line else [])]
    shown = [(named[i] or str(columns[i] + 1)) + (f" [{units[i]}]" if unit_line and units[i] else "") for i in kept]
    return ImportedData(
        samples=np.stack(list(kept.values()), axis=1),
        form="CSV",
        stamps=stamps,
        nominal=rate,
        names=tuple(named[i] for i in kept) if names else (),
        units=tuple(units[i] for i in kept) if any(units) else (),
        simulated="SIMULATED" in comments,
        report=(f"Text read as {', '.join(said)}.", "; ".join([f"Columns: {', '.join(shown[:20])}", *left]) + "."),
    )


def _lines(text: str, given: ImportOptions) -> tuple[list[tuple[int, str]], list[str], str]:
    """Lines with their numbers, without comments and empty ones; the comments; and the separator if it is stated."""
    text = _GROUPS.sub("", text).replace("\u2212", "-")
    lines = list(enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1))[given.skip :]
    lines = [(number, line) for number, line in lines if line.strip()]
    stated = given.separator or ""
    if lines and (found := re.fullmatch(r"sep=(.)\s*", lines[0][1])):
        lines, stated = lines[1:], stated or found[1]
    comments = [line.lstrip("#%/; ") for _, line in lines if line.startswith(_COMMENTS)]
    lines = [(number, line) for number, line in lines if not line.startswith(_COMMENTS)]
    if lines and (first := _MONITOR.match(lines[0][1])):
        rest = lines[0][1][first.end() :]
        mark = next((sign for sign in "\t;," if sign in rest), " ")
        lines = [(number, _MONITOR.sub(lambda one: one[1].replace(",", ".") + mark, line)) for number, line in lines]
    separator = SEPARATORS.get(stated, stated)
    if len(separator) > 1:
        raise InputError(f"separator: expected {', '.join(SEPARATORS)} or one character, got {stated!r}")
    return lines, comments, separator


def _separator(sample: Sequence[str], given: ImportOptions) -> str:
    """The separator by which most fields are numbers or times, in lines of equal numbers of fields."""
    best, separator = 0.0, _ONE_COLUMN
    for sign in SEPARATORS.values():
        rows = [row.fields for row in _rows(list(enumerate(sample)), sign)]
        width, count = Counter(map(len, rows)).most_common(1)[0] if rows else (0, 0)
        filled = [field for row in rows for field in row if field]
        share = sum(map(_is_value, filled)) / max(1, len(filled))
        if width > 1 and 2 * count >= len(rows) and share > best and (sign, given.decimal) != (",", "comma"):
            best, separator = share, sign
    if separator == "," and given.decimal is None and any(re.search(r"(?:^|,)0\d*,0\d", line) for line in sample):
        raise InputError(
            f"expected one reading of {sample[-1][:40]!r}, got two: commas of decimals, and between columns",
            parameters={"decimal": 'decimal="comma", or "point" for columns'},
        )
    return separator


def _rows(lines: Sequence[tuple[int, str]], separator: str) -> list[_Row]:
    if separator == " ":
        return [_Row(number, line.split()) for number, line in lines]
    texts = report_progress([line for _, line in lines], len(lines))
    reader = csv.reader(texts, delimiter=separator, skipinitialspace=True)
    rows = [_Row(lines[reader.line_num - 1][0], [field.strip() for field in fields]) for fields in reader]
    return [row for row in rows if any(row.fields)]


def _decimal(rows: Sequence[_Row]) -> Decimal:
    """The sign of decimals; InputError if commas may be of decimals and of thousands."""
    some = rows[len(rows) // 2 :]
    later = (field for row in some[:: 1 + len(some) // 2000] for field in row.fields)
    fields = [field for field in later if re.fullmatch(r"[-+.,\deE]*\d", field)]
    commas = [field for field in fields if "," in field]
    last = {field.rfind(",") > field.rfind(".") for field in commas if "." in field}
    grouped = all(re.fullmatch(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+", field) for field in commas)
    if not commas or last == {False} or (grouped and any("." in field or field.count(",") > 1 for field in fields)):
        return "point"
    if grouped:
        raise InputError(
            f"expected one reading of {commas[0]!r}, got two: a comma of decimals, and of thousands",
            parameters={"decimal": 'decimal="comma" or "point"'},
        )
    return "comma"


def _number(field: str, decimal: Decimal) -> float | None:
    """Number of a field, NaN for an empty one and for a mark of an overflow; None for other text."""
    sign, other = (".", ",") if decimal == "point" else (",", ".")
    if not field or field.lower() in _MARKS:
        return np.nan
    whole, point, rest = field.partition(sign)
    if re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}(?:\{other}\d{{3}})+", whole):
        whole = whole.replace(other, "")
    # Python reads 1_000 as 1000; other programs write no underscores in numbers.
    if other in whole + rest or "_" in field or not is_number(text := whole + point.replace(",", ".") + rest):
        return None
    return np.nan if float(text) in _SCPI else float(text)


def _is_value(field: str) -> bool:
    """True for a number with any sign of decimals, a time or date, a mark of an overflow, or a number with a label."""
    if _number(field, "point") is not None or _number(field, "comma") is not None:
        return True
    found = _TIME.fullmatch(field)
    return (found is not None and bool(found["m"] or found["date"])) or _LABEL.fullmatch(field) is not None


def _place(rows: Sequence[_Row]) -> tuple[list[int], int]:
    """Columns that hold anything in the second half of the rows, and the number of rows before the first numbers."""
    later = [row.fields for row in rows[len(rows) // 2 :]]
    # If two widths are as common there, that of most rows counts: few rows miss a field.
    often, widths = Counter(map(len, later)), Counter(len(row.fields) for row in rows)
    width = max(often, key=lambda each: (often[each], widths[each]), default=0)
    columns = [i for i in range(width) if any(len(fields) == width and fields[i] for fields in later)]
    labels = bool(later) and all(map(_LABEL.fullmatch, later[-1]))
    counted = [str(i) for i in range(len(columns))]
    whole = bool(rows) and all(field.isdecimal() for field in rows[-1].fields)
    for start, row in enumerate(rows):
        first = next((row.fields[i] for i in columns if i < len(row.fields) and row.fields[i]), "---")
        # Names of pandas where there are none, with its index or without it.
        numbered = len(columns) > 2 and (row.fields == ["", *counted[:-1]] or (row.fields == counted and not whole))
        if _is_value(first) and not numbered and (labels or not _LABEL.fullmatch(first)):
            return columns, start
    return columns or [0], len(rows)


def _names(
    head: Sequence[_Row], columns: Sequence[int], given: ImportOptions, line: int
) -> tuple[tuple[str, ...], list[str], int]:
    """Names and units of the columns, and the line of the units; (), [] and 0 for none."""
    stated = [row for row in head if row.line == given.unit_row]
    if given.unit_row and not stated:
        raise InputError(f"unit_row: expected a line before the numbers in line {line}, got {given.unit_row}")
    titles = [row.fields[1:] for row in head if row.fields[0].lower() == "channeltitle="]  # of LabChart
    if titles and len(titles[0]) == len(columns) - 1:
        return ("", *titles[0]), [], 0
    wide = [row for row in head if len(row.fields) > columns[-1] and row not in stated]
    if given.unit_row is None and wide and _are_units([wide[-1].fields[i] for i in columns], alone=len(wide) == 1):
        stated = [wide[-1]]
        wide = wide[:-1] or wide
    listed = [row.fields for row in head if row.fields[0].lower() == "y_unit_label"]  # of LabVIEW
    units = [(fields[i] if 0 < i < len(fields) else "") for fields in listed[-1:] for i in columns]
    units = [_bare(row.fields[i]) for row in stated for i in columns] or units
    found = _row_of_names(wide[-1].fields, "", columns) if wide else ()
    found = found or tuple(row.fields[i] for row in stated for i in columns)
    last = [field for row in head[-1:] for field in row.fields if field]
    if not found and not stated and 1 < len(last) <= columns[-1] and not any(map(is_number, last)):
        raise _ragged(len(last), line, columns[-1] + 1)
    return found, units, stated[0].line if stated else 0


def _row_of_names(row: str | list[str], separator: str, columns: Sequence[int]) -> tuple[str, ...]:
    """Names of the columns in a row of fields, or in a comment in which NumPy writes them; () if it holds others."""
    fields = row if isinstance(row, list) else [field.strip() for field in row.split(separator.strip() or None)]
    if len(fields) <= columns[-1] or (row is not fields and len(fields) != len(columns) > 1):
        return ()
    found = tuple(fields[i] for i in columns)
    numbers = [field for field in found if is_number(field)]
    fits = not numbers or (len(numbers) > 1 and numbers == [str(i) for i in range(len(numbers))])
    return found if fits and not _RATE.search(" ".join(found)) and (row is fields or len(found) > 1) else ()


def _are_units(fields: Sequence[str], *, alone: bool) -> bool:
    """True for units, or any text after one of time; without a row of names above it, a letter such as a is a name."""
    plain = list(map(_bare, fields))
    if not alone and len(fields) > 1 and is_clock(f"t [{plain[0]}]") and not any(map(is_number, fields)):
        return True
    return all(
        known_unit(unit)[0] is not None
        or is_clock(f"t [{unit}]")
        or (not alone and (unit.lower() in WORDS["quantities"] or field[:1] + field[-1:] in ("()", "[]")))
        for unit, field in zip(plain, fields, strict=True)
    )


def _bare(unit: str) -> str:
    """A unit without the brackets around it."""
    return re.sub(r"^[\[(]\s*(.*?)\s*[\])]$", r"\1", unit)


def _labelled(body: Sequence[_Row]) -> tuple[tuple[str, ...], list[_Row]]:
    """Labels of numbers such as ``a0:512``, which are the same in all rows, and the rows without them."""
    found = [[_LABEL.fullmatch(field) for field in row.fields] for row in body]
    names = tuple(each[1].strip() if each else "" for each in found[0])
    for row, each in zip(body, found, strict=True):
        if tuple(one[1].strip() if one else "" for one in each) != names:
            raise BrokenFileError(f"expected the labels {', '.join(names)}, got others in line {row.line}")
    return names, [_Row(row.line, [one[2] for one in each if one]) for row, each in zip(body, found, strict=True)]


def _check_widths(body: Sequence[_Row], width: int) -> None:
    for row in body:
        if len(row.fields) < width or any(row.fields[width:]):
            raise _ragged(width, row.line, len(row.fields))


def _ragged(width: int, line: int, got: int) -> BrokenFileError:
    return BrokenFileError(f"expected {width} columns in line {line}, got {got}; the file is truncated or rows differ")


def _facts(
    comments: Sequence[str], head: Sequence[_Row], body: Sequence[_Row], columns: Sequence[int], decimal: Decimal
) -> tuple[float | None, str]:
    """Rate in Hz and unit that the text states beside its numbers; None for no rate or several, "" for no unit."""
    # Oscilloscopes of Tektronix write notes beside the first numbers, and those of Rigol in two rows of more columns.
    rows = [*(row.fields for row in head), *(row.fields[: columns[0]] for row in body[:20])]
    pairs = [f"{name} {value}" for one, two in pairwise(rows) for name, value in zip(one, two, strict=False)]
    text = "\n".join([*comments, *map(" ".join, rows), *pairs])
    text = text.replace(",", ".") if decimal == "comma" else text
    text = _PER_SAMPLE.sub(r"sampling period: \1 \2s", text)  # of AcqKnowledge
    large, small = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}, {"": 1.0, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "n": 1e-9}
    rates = {float(value) * large.get(factor.lower(), np.nan) for value, factor in _RATE.findall(text)}
    steps = {float(value) * small.get(factor.lower(), np.nan) for value, factor in _STEP.findall(text)} - {0.0}
    found = {float(f"{rate:.9g}") for rate in (*rates, *(1 / step for step in steps))}
    units = {unit for unit in _VERTICAL.findall(text) if known_unit(unit)[0] or unit.lower() in WORDS["quantities"]}
    return found.pop() if len(found) == 1 else None, units.pop() if len(units) == 1 else ""


def _converted(
    body: Sequence[_Row], columns: Sequence[int], names: Sequence[str], decimal: Decimal, *, gaps: bool
) -> tuple[dict[int, Array], Array | None, list[str]]:
    """Numbers by place in `columns`, times of the rows in s from times of day, and what was done with other columns."""
    kept: dict[int, Array] = {}
    left: list[str] = []
    total, timed = np.zeros(len(body)), False
    for i, column in enumerate(columns):
        fields = [row.fields[column] for row in body]
        where = _column(i, columns, names)
        times = [one.groupdict() for one in map(_TIME.fullmatch, fields[:1]) if one and (one["m"] or one["date"])]
        if times:
            times += [
                one.groupdict() if one else times[0] | {"m": None, "date": None}
                for one in map(_TIME.fullmatch, fields[1:])
            ]
            clock = times[0]["m"] is not None
            total, timed = total + _seconds(times), timed or clock
            left.append(f"{where} holds {'times of day' if clock else 'dates'}")
        elif len(body) > 2 and not any(map(_is_value, filter(None, fields))):
            left.append(f"{where} has no numbers and is left out")
        else:
            kept[i] = _numbers(fields, body, where, decimal, gaps=gaps)
            wraps = np.diff(kept[i], prepend=kept[i][:1]) < -(2.0**31)
            if wraps.any() and 0 <= kept[i].min() <= kept[i].max() < 2**32:
                # Clocks of microcontrollers have 32 bits.
                kept[i] = kept[i] + 2.0**32 * np.cumsum(wraps)
                left.append(f"{where} started again at 2^32")
    midnight = np.concatenate([[0], np.cumsum(np.diff(total) < -43_200)])
    return kept, total + 86_400.0 * midnight if timed else None, left


def _column(i: int, columns: Sequence[int], names: Sequence[str]) -> str:
    return f"column {names[i]!r}" if names[i] else f"column {columns[i] + 1}"


def _even_step(values: Array) -> float:
    """Step of a column that increases evenly, 0 for another."""
    steps = np.diff(values[np.isfinite(values)])
    return float(np.median(steps)) if len(steps) > 2 and 0 <= np.ptp(steps) <= 1e-2 * steps[0] else 0.0


def _below_a_date(kept: Mapping[int, Array]) -> float | None:
    """Rate in Hz in the second row, below a date in the first, as Empatica writes them; None for other numbers."""
    values = np.stack(list(kept.values()), axis=1)
    top, small = values[:2], len(values) > 2 and np.abs(values[2:]).max() < 1e6
    return float(top[1, 0]) if small and (top == top[:, :1]).all() and top[0, 0] > 1e9 > 1e5 > top[1, 0] > 0 else None


def _seconds(times: Sequence[Mapping[str, str | None]]) -> Array:
    """Seconds since the first midnight; each change of the date is one day, so that missing days are a gap."""
    dates = [one["date"] for one in times]
    days = np.concatenate([[0], np.cumsum([a != b for a, b in pairwise(dates)])])

    def part(one: Mapping[str, str | None], name: str) -> float:
        return float((one[name] or "0").replace(",", "."))

    hours = [
        part(one, "h") % 12 + 12 * (one["half"].lower() == "pm") if one["half"] else part(one, "h") for one in times
    ]
    rest = [60 * part(one, "m") + part(one, "s") + 1e-3 * part(one, "ms") for one in times]
    return 86_400.0 * days + 3600 * np.array(hours) + rest


def _counted(values: Array) -> Array | None:
    """Numbers of the rows from 0 on, if the values count them; a counter may start again at its least value."""
    if len(values) < 3 or not np.isfinite(values).all() or (values != np.round(values)).any():
        return None
    steps = np.diff(values)
    steps[steps < 0] += np.ptp(values) + 1
    return np.concatenate([[0], np.cumsum(steps)]) if steps.min() > 0 and np.median(steps) == 1 else None


def _numbers(fields: Sequence[str], body: Sequence[_Row], where: str, decimal: Decimal, *, gaps: bool) -> Array:
    try:
        values = np.array(fields, np.float64)
        plain = not any("_" in field for field in fields) and not np.isin(values, _SCPI).any()
    except ValueError:
        values, plain = np.zeros(0), False
    if not plain:
        found = [_number(field, decimal) for field in fields]
        if None in found:
            at = found.index(None)
            raise BrokenFileError(f"expected a number, got {fields[at][:40]!r} in line {body[at].line}, {where}")
        values = np.array(found, np.float64)
    if gaps:
        return np.where(np.isfinite(values), values, np.nan)
    if not np.isfinite(values).all():
        at = int(np.argmin(np.isfinite(values)))
        got = f"finite numbers, got {fields[at]}" if fields[at] else "a number, got an empty field"
        raise NonFiniteError(f"expected {got} in line {body[at].line}, {where}; midair import --mend fills short gaps")
    return values
