"""The solvers by name."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Any

from midair.errors import InputError
from midair.solvers.amplitudes import Amplitudes
from midair.solvers.exact import Exact
from midair.solvers.fast import Fast
from midair.solvers.glide import Glide
from midair.solvers.levenberg_marquardt import LevenbergMarquardt
from midair.solvers.live import Live
from midair.solvers.problem import Start, Term
from midair.solvers.reference import GSPAT, GerchbergSaxton, Greedy, Naive, WeightedGerchbergSaxton
from midair.solvers.terms import Fit, Guard, QuietPalm

Method = (
    LevenbergMarquardt
    | Exact
    | Fast
    | Glide
    | Live
    | Naive
    | GerchbergSaxton
    | WeightedGerchbergSaxton
    | GSPAT
    | Greedy
)

METHODS: Mapping[str, Callable[[], Method]] = MappingProxyType(
    {
        "lm": LevenbergMarquardt,
        "exact": Exact,
        "fast": Fast,
        "glide": Glide,
        "live": Live,
        "naive": Naive,
        "gs": GerchbergSaxton,
        "wgs": WeightedGerchbergSaxton,
        "gs-pat": GSPAT,
        "greedy": Greedy,
    }
)
"""Name of each method and how to make it with its default settings."""


TAKES: Mapping[str, frozenset[Term]] = MappingProxyType(
    {
        "lm": frozenset({"guard", "quiet-ears", "quiet-palm", "amplitudes", "robust"}),
        "exact": frozenset({"amplitudes", "robust"}),
        "fast": frozenset({"guard", "quiet-ears", "quiet-palm", "cells", "smooth", "amplitudes", "robust"}),
        "glide": frozenset({"guard", "quiet-ears", "quiet-palm", "cells", "amplitudes", "robust"}),
        "live": frozenset({"amplitudes", "robust"}),
        "naive": frozenset(),
        "gs": frozenset(),
        "wgs": frozenset(),
        "gs-pat": frozenset(),
        "greedy": frozenset(),
    }
)
"""Terms that each method takes beside the paper's error; the published ones stay as published."""


def terms_of(
    *,
    amplitudes: Amplitudes = "equal",
    guard: float | Guard | None = None,
    fit: Fit = "points",
    smooth: float = 0.0,
    robust: float = 0.0,
    quiet_ears: float = 0.0,
    quiet_palm: float | QuietPalm = 0.0,
    **_: object,
) -> frozenset[Term]:
    """Terms beside the paper's error that arguments of `midair.solve` switch on; the other arguments are ignored."""
    switched: dict[Term, bool] = {
        "amplitudes": amplitudes == "bounded",
        "guard": guard is not None,
        "cells": not isinstance(fit, str) or fit != "points",
        "smooth": smooth > 0,
        "robust": robust > 0,
        "quiet-ears": quiet_ears > 0,
        "quiet-palm": isinstance(quiet_palm, QuietPalm) or quiet_palm > 0,
    }
    return frozenset(term for term, on in switched.items() if on)


def check_terms(method: str | Method, asked: Iterable[Term]) -> None:
    """Refuse terms that the method would not look at.

    Raises
    ------
    InputError
        If there are any.
    """
    method = name_of(method)
    left = sorted(set(asked) - TAKES[method])
    if left:
        able = [name for name, taken in TAKES.items() if taken >= set(left)]
        taken = ", ".join(sorted(TAKES[method])) or "none"
        raise InputError(
            f"method {method}: expected terms that it takes ({taken}), got {', '.join(left)}; "
            f"choose {' or '.join([*able, *(['fit points'] if 'cells' in left else [])])}"
        )


def name_of(method: str | Method) -> str:
    """The name in `METHODS` of a configured solver; a name as it is.

    Raises
    ------
    InputError
        If it is neither.
    """
    if isinstance(method, str):
        return method
    for name, kind in METHODS.items():
        if type(method) is kind:
            return name
    raise InputError(f"method: expected one of {', '.join(METHODS)} or a solver of midair.solvers, got {method!r}")


def solver(
    method: str | Method,
    *,
    iterations: int | tuple[int, int] | None = None,
    start: Start | None = None,
    backend: str | None = None,
    jobs: int | None = None,
) -> Method:
    """The method of this name, or the configured one, with other iterations and another start where it has them.

    Parameters
    ----------
    method : str or a solver
        A name in `METHODS`, or a solver of this package such as ``Fast(iterations=60)``, kept as it is but for what
        is given here.
    iterations : int or tuple of int, optional
        Largest number, for every frame or for frames that start at zero and for those that start at the previous one.
    start : {"previous", "zero"}, optional
        Start of every frame after the first. Methods that solve each frame on its own have none, and "live" always
        goes on from the frame before.
    backend : str, optional
        What does the arithmetic, see `backend.backend`; the method's own if None. Only "fast" and "glide" have the
        choice.

    jobs : int, optional
        Blocks at once, for "glide"; the others have none.

    Raises
    ------
    InputError
        If the method or the start is unknown, the iterations are below 1 or given to "glide", which has some for each
        kind of frame, two numbers of iterations are given to
        a method that has one, or a backend to one that has none.
    """
    if isinstance(method, str) and method not in METHODS:
        raise InputError(f"method: expected one of {', '.join(METHODS)}, got {method!r}")
    name = name_of(method)
    if start not in (None, "previous", "zero"):
        raise InputError(f"start: expected previous or zero, got {start!r}")
    settings = METHODS[method]() if isinstance(method, str) else method
    has = {field.name for field in fields(settings)}
    changes: dict[str, Any] = {}
    if start is not None and "start" in has:
        changes["start"] = start
    if backend is not None:
        if "backend" not in has:
            raise InputError(f"backend: expected method fast or glide, got {name}; the others are NumPy's or Numba's")
        changes["backend"] = backend
    if jobs is not None and "jobs" in has:
        changes["jobs"] = jobs
    if iterations is not None and name == "glide":
        raise InputError("iterations: expected none with glide, which has some for each kind of frame; see Glide")
    if iterations is not None:
        changes |= _iterations(name, iterations, "warm_iterations" in has)
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
