"""Which figures of two records differ."""

import re
from collections import Counter, defaultdict
from dataclasses import dataclass
from difflib import SequenceMatcher
from itertools import zip_longest


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A comparison as text, and how many figures differ."""

    text: str
    differ: int


def compared(old: dict[str, str], new: dict[str, str]) -> Report:
    """Compare two records.

    Named figures are compared by name, numbers of a text in their order: one more or one less does not make those
    behind it differ. Equal all the same, but counted, are numbers of a text that stand at another place of the same
    command's output, and arrays that the same command writes under another name.
    """
    lost, found = _unequal(old, new)
    movable = [Counter(_key(name, old) for name in lost if _moves(name, old, new))]
    movable += [Counter(_key(name, new) for name in found if _moves(name, new, old))]
    moved = movable[0] & movable[1]
    lost, found = _without(moved, lost, old, new), _without(moved, found, new, old)
    places: dict[str, tuple[list[str], list[str]]] = defaultdict(lambda: ([], []))
    for side, names in enumerate((lost, found)):
        for name in names:
            places[_place(name)][side].append(name)
    lines = [
        _line(before or after, old.get(before), new.get(after))
        for one, other in places.values()
        for before, after in zip_longest(one, other, fillvalue="")
    ]
    head = f"{len(old)} figures before, {len(new)} now: {len(old) - len(lost)} equal, {len(lines)} differ"
    if moved:
        head += f"; {moved.total()} of the equal ones stand at another place or under another name"
    return Report(text="\n".join([head, *sorted(lines)]), differ=len(lines))


def _unequal(old: dict[str, str], new: dict[str, str]) -> tuple[list[str], list[str]]:
    """Names of the figures of each record that the other does not have at their place."""
    places: dict[str, tuple[list[str], list[str]]] = defaultdict(lambda: ([], []))
    for side, record in enumerate((old, new)):
        for name in sorted(record):
            places[_place(name)][side].append(name)
    lost: list[str] = []
    found: list[str] = []
    for before, after in places.values():
        values = [_number(old[name]) for name in before], [_number(new[name]) for name in after]
        if values[0] == values[1]:
            continue
        for kind, a, b, c, d in SequenceMatcher(None, *values, autojunk=False).get_opcodes():
            if kind != "equal":
                lost += before[a:b]
                found += after[c:d]
    return lost, found


def _place(name: str) -> str:
    """Where a figure stands: its name, without the place in a sequence."""
    return name.partition("#")[0]


def _key(name: str, record: dict[str, str]) -> tuple[str, str | float]:
    """The command of a figure, and its value."""
    return name.partition(" | ")[0], _number(record[name])


def _moves(name: str, record: dict[str, str], other: dict[str, str]) -> bool:
    """Whether a figure is known again elsewhere: a number of a text, or an array whose name the other does not have."""
    return "#" in name or ("sha256" in record[name] and name not in other)


def _without(
    moved: Counter[tuple[str, str | float]], names: list[str], record: dict[str, str], other: dict[str, str]
) -> list[str]:
    left = Counter(moved)
    kept: list[str] = []
    for name in names:
        if _moves(name, record, other) and left[_key(name, record)]:
            left[_key(name, record)] -= 1
        else:
            kept.append(name)
    return kept


def _number(value: str) -> str | float:
    """A figure as it is compared: numbers by their value, so that .5 is 0.5."""
    try:
        number = float(value)
    except ValueError:
        return value
    return number if number == number else value


def _line(name: str, before: str | None, after: str | None) -> str:
    """One difference, and how large it is."""
    if before is None or after is None:
        return f"{name}: {'none' if before is None else before} -> {'none' if after is None else after}"
    one, other = _size(before), _size(after)
    if isinstance(one, str) or isinstance(other, str):
        return f"{name}: {before} -> {after}"
    relative = abs(other - one) / abs(one) if one else float("inf")
    return f"{name}: {before} -> {after}, relative difference {relative:.2g}"


def _size(value: str) -> str | float:
    """The number of a figure; of an array its root of the mean square."""
    found = re.search(r"rms (\S+)", value)
    return _number(found[1] if found else value)
