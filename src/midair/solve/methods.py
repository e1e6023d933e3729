"""The solvers by name."""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

from midair.errors import InputError
from midair.solve.exact import Exact
from midair.solve.fast import Fast
from midair.solve.levenberg_marquardt import LevenbergMarquardt
from midair.solve.live import Live
from midair.solve.problem import Start
from midair.solve.reference import GSPAT, GerchbergSaxton, Greedy, Naive, WeightedGerchbergSaxton

Method = LevenbergMarquardt | Exact | Fast | Live | Naive | GerchbergSaxton | WeightedGerchbergSaxton | GSPAT | Greedy

METHODS: Mapping[str, Callable[[], Method]] = MappingProxyType(
    {
        "lm": LevenbergMarquardt,
        "exact": Exact,
        "fast": Fast,
        "live": Live,
        "naive": Naive,
        "gs": GerchbergSaxton,
        "wgs": WeightedGerchbergSaxton,
        "gs-pat": GSPAT,
        "greedy": Greedy,
    }
)
"""Name of each method and how to make it with its default settings."""


def solver(method: str, *, iterations: int | tuple[int, int] | None = None, start: Start | None = None) -> Method:
    """The method of this name with other iterations and another start, where it has them.

    Parameters
    ----------
    method : str
        A name in `METHODS`.
    iterations : int or tuple of int, optional
        At most: for every frame, or for frames that start at zero and for those that start at the previous one.
    start : {"previous", "zero"}, optional
        Of every frame after the first. Methods that solve each frame on its own have none, and "live" always goes on
        from the frame before.

    Raises
    ------
    InputError
        If the method or the start is unknown, the iterations are below 1, or two numbers of iterations are given to
        a method that has one.
    """
    if method not in METHODS:
        raise InputError(f"method: expected one of {', '.join(METHODS)}, got {method!r}")
    if start not in (None, "previous", "zero"):
        raise InputError(f"start: expected previous or zero, got {start!r}")
    settings = METHODS[method]()
    has = {field.name for field in fields(settings)}
    changes: dict[str, Any] = {}
    if start is not None and "start" in has:
        changes["start"] = start
    if iterations is not None:
        changes |= _iterations(method, iterations, "warm_iterations" in has)
    return replace(settings, **changes)


def _iterations(method: str, iterations: int | tuple[int, int], warm: bool) -> dict[str, int]:
    first, later = (iterations, iterations) if isinstance(iterations, int) else iterations
    if first < 1 or later < 1:
        raise InputError(f"iterations: expected 1 or more, got {iterations}")
    if warm:
        return {"iterations": first, "warm_iterations": later}
    if first != later:
        raise InputError(f"iterations: expected one number, since {method} solves all frames alike, got {iterations}")
    return {"iterations": first}
