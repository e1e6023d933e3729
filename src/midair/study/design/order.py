"""Orders: balanced Latin squares, and shuffles without long runs."""

from collections import Counter
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from midair.errors import InputError

Item = TypeVar("Item")


def balanced_latin_square(count: int) -> list[list[int]]:
    """Orders of `count` conditions in which each stands equally often in each place and after each other one.

    The design of Williams (1949): 0, 1, n-1, 2, n-2, ... shifted by one a row; for an odd number every row also comes
    backwards.

    Parameters
    ----------
    count : int
        1 or more.

    Returns
    -------
    list of list of int
        `count` rows, or twice as many for an odd count above 1.
    """
    if count < 1:
        raise InputError(f"Latin square: expected 1 condition or more, got {count}")
    first = [(place + 1) // 2 if place % 2 else (count - place // 2) % count for place in range(count)]
    square = [[(value + row) % count for value in first] for row in range(count)]
    return square + [row[::-1] for row in square] if count % 2 and count > 1 else square


def constrained_shuffle(
    items: Sequence[Item], *, rng: np.random.Generator, longest_run: int = 0, tries: int = 1000
) -> list[Item]:
    """A random order in which no item stands more than `longest_run` times in a row.

    All such orders are equally likely (by rejection) unless they are so rare that `tries` shuffles miss them; then one
    is built item by item.

    Parameters
    ----------
    items : sequence
        May repeat.
    rng : Generator
        Draws the shuffle.
    longest_run : int
        0 for no limit.
    tries : int
        Shuffles before one is built.

    Raises
    ------
    InputError
        If no order keeps the limit.
    """
    if longest_run:
        _check_feasible(items, longest_run)
    for _ in range(tries):
        order = [items[i] for i in rng.permutation(len(items))]
        if not longest_run or longest_run_of(order) <= longest_run:
            return order
    return _built(list(items), rng, longest_run)


def longest_run_of(items: Sequence[object]) -> int:
    """Most equal items in a row."""
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


def _built(items: list[Item], rng: np.random.Generator, longest_run: int) -> list[Item]:
    left, order = Counter(items), list[Item]()
    while left.total():
        run = 0
        while run < len(order) and order[-1 - run] == order[-1]:
            run += 1
        allowed = [item for item in left if left[item] and _can_follow(item, left, order, run, longest_run)]
        # As from an urn: what is left more often comes sooner, and is not piled up for the end.
        weight = np.array([left[item] for item in allowed], float)
        chosen = allowed[int(rng.choice(len(allowed), p=weight / weight.sum()))]
        left[chosen] -= 1
        order.append(chosen)
    return order


def _can_follow(item: Item, left: Counter[Item], order: list[Item], run: int, longest_run: int) -> bool:
    """Whether the rest can still be laid out once this item is taken."""
    now = run + 1 if order and order[-1] == item else 1
    if now > longest_run:
        return False
    rest = Counter(left)
    rest[item] -= 1
    total = rest.total()
    for other, count in rest.items():
        start = longest_run - now if other == item else longest_run
        # Each of the others can part two runs; more than these runs hold would have to stand together.
        if count > start + longest_run * (total - count):
            return False
    return True
