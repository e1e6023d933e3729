"""Trial orders: balanced Latin squares and shuffles without long runs."""

from collections import Counter
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from midair.errors import InputError

Item = TypeVar("Item")


def balanced_latin_square(count: int) -> list[list[int]]:
    """Orders of `count` conditions that balance position and immediate carry-over.

    The design of Williams (1949): each row is 0, 1, n-1, 2, n-2, ... plus the row number, so `count` rows; for an odd
    count above 1 the reversed rows are added.
    """
    if count < 1:
        raise InputError(f"Latin square: expected 1 condition or more, got {count}")
    first = [(place + 1) // 2 if place % 2 else (count - place // 2) % count for place in range(count)]
    square = [[(value + row) % count for value in first] for row in range(count)]
    return square + [row[::-1] for row in square] if count % 2 and count > 1 else square


def constrained_shuffle(
    items: Sequence[Item], *, rng: np.random.Generator, longest_run: int = 0, tries: int = 1000
) -> list[Item]:
    """Random order in which no item stands more than `longest_run` times in a row (0: no limit).

    All such orders are equally likely (rejection sampling), unless `tries` shuffles find none; then one order is built
    item by item. Raises InputError if no order keeps the limit.
    """
    if longest_run:
        _check_feasible(items, longest_run)
    for _ in range(tries):
        order = [items[i] for i in rng.permutation(len(items))]
        if not longest_run or longest_run_of(order) <= longest_run:
            return order
    return _build_order(list(items), rng, longest_run)


def longest_run_of(items: Sequence[object]) -> int:
    """Largest number of equal items in a row."""
    longest = run = 0
    for i, item in enumerate(items):
        run = run + 1 if i and items[i - 1] == item else 1
        longest = max(longest, run)
    return longest


def _check_feasible(items: Sequence[object], longest_run: int) -> None:
    item, most = Counter(items).most_common(1)[0]
    others = len(items) - most
    if most > longest_run * (others + 1):
        raise InputError(
            f"order: expected runs of at most {longest_run}, got {most} trials of {item!r} among {others} others;"
            " allow longer runs or add other stimuli"
        )


def _build_order(items: list[Item], rng: np.random.Generator, longest_run: int) -> list[Item]:
    left, order = Counter(items), list[Item]()
    while left.total():
        run = 0
        while run < len(order) and order[-1 - run] == order[-1]:
            run += 1
        allowed = [item for item in left if left[item] and _can_follow(item, left, order, run, longest_run)]
        # Weighted by the remaining count, so that frequent items do not pile up at the end.
        weight = np.array([left[item] for item in allowed], float)
        chosen = allowed[int(rng.choice(len(allowed), p=weight / weight.sum()))]
        left[chosen] -= 1
        order.append(chosen)
    return order


def _can_follow(item: Item, left: Counter[Item], order: list[Item], run: int, longest_run: int) -> bool:
    """Whether the remaining items can still be ordered after this item."""
    now = run + 1 if order and order[-1] == item else 1
    if now > longest_run:
        return False
    rest = Counter(left)
    rest[item] -= 1
    total = rest.total()
    for other, count in rest.items():
        start = longest_run - now if other == item else longest_run
        # Each other item can separate two runs; a count above the capacity of these runs breaks the limit.
        if count > start + longest_run * (total - count):
            return False
    return True
