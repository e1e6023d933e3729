"""The solvers by name, and the settings of a solution: the method and the terms of the objective."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from numbers import Integral, Real
from types import MappingProxyType
from typing import Any, Literal, TypeVar

from midair.errors import InputError
from midair.model import Acoustics, Setting
from midair.solvers.fast import Fast
from midair.solvers.free import Free
from midair.solvers.glide import Glide
from midair.solvers.levenberg_marquardt import LevenbergMarquardt
from midair.solvers.live import Live
from midair.solvers.problem import Start
from midair.solvers.terms.amplitudes import Amplitudes
from midair.solvers.terms.fit import Cells, Fit, FitName, Windows, pressure_means
from midair.solvers.terms.guard import Guard
from midair.solvers.terms.quiet_ears import QuietEars
from midair.solvers.terms.quiet_palm import QuietPalm
from midair.solvers.terms.temperatures import airs_around
from midair.validation import Declared, check_calls, documented, one_of, setting, within

Method = LevenbergMarquardt | Fast | Glide | Free | Live

METHODS: Mapping[str, type[Method]] = MappingProxyType(
    {
        "lm": LevenbergMarquardt,
        "fast": Fast,
        "glide": Glide,
        "free": Free,
        "live": Live,
    }
)
"""Name and settings of each method."""

for _kind in METHODS.values():
    check_calls(_kind)


def takes(method: str | Method) -> frozenset[str]:
    """Names of the terms that a method supports besides the error of the paper."""
    return METHODS[name_of(method)].terms


def name_of(method: str | Method) -> str:
    """The name in `METHODS` of a configured solver, or the name itself.

    Raises InputError if the argument is neither a name nor a solver of `METHODS`.
    """
    for name, kind in METHODS.items():
        if type(method) is kind or method == name:
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
    """The solver of this name, or the given solver, with other settings where the method has them.

    `method` is a name in `METHODS`, or a solver such as ``Fast(iterations=60)``. `iterations` is the maximum for every
    frame, or for frames that start at zero and frames that start at the previous one; `start` ("previous", "zero") that
    of every frame after the first; `backend` the array library of "fast" and "glide", see `backend.backend`; `jobs` the
    number of worker threads of "glide". Methods without a start or jobs ignore them. Raises InputError if the method or
    the start is unknown; if iterations are below 1, are given to "glide" (which has its own for each kind of frame), or
    are two numbers for a method that has one; if a backend is given to a method that has none.
    """
    name = name_of(method)
    if start not in (None, "previous", "zero"):
        raise InputError(f"start: expected previous or zero, got {start!r}")
    settings = METHODS[method]() if isinstance(method, str) else method
    has = {field.name for field in fields(settings)}
    if backend is not None and "backend" not in has:
        raise InputError(f"backend: expected method fast or glide, got {name}; the others run on NumPy or Numba")
    changes: dict[str, Any] = {"start": start, "backend": backend, "jobs": jobs}
    if iterations is not None:
        if name == "glide":
            raise InputError("iterations: expected none with glide; set those of each kind of frame in Glide(...)")
        first, later = iterations if isinstance(iterations, tuple) else (iterations, iterations)
        if not all(isinstance(each, Integral) and each >= 1 for each in (first, later)):
            raise InputError(f"iterations: expected 1 or more, got {iterations!r}")
        if first != later and "warm_iterations" not in has:
            raise InputError(f"iterations: expected one number, since {name} solves all frames alike, got {iterations}")
        changes |= {"iterations": first, "warm_iterations": later}
    return replace(settings, **{key: value for key, value in changes.items() if value is not None and key in has})


T = TypeVar("T")


def _term(value: float | T | None, made: Callable[[float], T]) -> T | None:
    """A term, or the one that is made of its number; None for 0 and None."""
    number: Any = value
    return (made(float(number)) if number else None) if isinstance(number, Real) else number


@documented
@dataclass(frozen=True, slots=True, kw_only=True)
class SolverSettings(Declared):
    """Settings of the solver, from target to drive: the method, and a setting for each term of the objective."""

    method: str | Method = setting(
        "lm",
        "Solver, a name in `METHODS` or a configured one such as ``Fast(iterations=60)``. lm: Levenberg-Marquardt of "
        "the paper (4.2); fast: batches of independent frames; glide: whole recordings, by bisection in time; free: an "
        "amplitude for each transducer, with little power; live: less than a millisecond per frame.",
    )
    iterations: int | tuple[int, int] | None = setting(
        None,
        "Maximum iterations for every frame, or for frames that start at zero and at the previous frame; the method's "
        "own if None.",
    )
    start: Start | None = setting(
        None,
        "Start of every frame after the first: the previous frame, or zero (4.2), which makes frames independent; lm "
        "alone has this choice. The method's own if None.",
    )
    level: float | Literal["auto"] = setting(
        1.0,
        "Drive of every transducer, above 0 to 1: the equal amplitude A (4.2); auto takes what the loudest frame "
        "needs, see `automatic_level`. Silent frames get 0.",
    )
    convergence: float | Literal["auto"] = setting(
        1.0,
        "Part of the phase that maps the whole array onto the square, 0 to 1: less keeps a weak touch over a range of "
        "heights, and quieter beside it; auto takes what the loudest frame needs, see `needed_convergence`.",
    )
    backend: str | None = setting(
        None, "Array library of fast and glide: numpy, torch, torch:cuda, cupy; NumPy if None."
    )
    jobs: int | None = setting(
        None, "Blocks that glide solves at once, 1 if None; it does not affect the result.", compare=False
    )
    amplitudes: Amplitudes = setting("equal", "All transducers equal, or each up to the level (bounded).")
    guard: float | Guard | None = setting(
        None, "Width of the quiet ring around the control points, or the ring; None or 0 for none.", unit="m"
    )
    fit: Fit = setting(
        "points", "Where the error is measured: control points, windows of 8 or 5.5 mm, or sensor cells."
    )
    smooth: float = setting(0.0, "Penalty on phase changes between frames; 0.01 is strong.")
    robust: float = setting(
        0.0, "Range below and above the temperature in which the phases stay accurate; with fit points alone.", unit="K"
    )
    quiet_ears: float | QuietEars | None = setting(0.0, "Penalty on sound at ears; 30 is strong.")
    quiet_palm: float | QuietPalm | None = setting(
        0.0, "Penalty on sound on the palm around the points, a disc of 100 mm or an outline; 0.1 is strong."
    )

    def __post_init__(self) -> None:
        name_of(self.method)
        if self.level != "auto":
            within(self.level, "level", 0, 1, above=True, advice="in parts of full drive, or auto")
        if self.convergence != "auto":
            within(self.convergence, "convergence", 0, 1, advice="a part of the phase, or auto")
        one_of(self.amplitudes, Amplitudes, "amplitudes")
        if not isinstance(self.fit, Windows | Cells):
            one_of(self.fit, FitName, "fit")
        within(self.smooth, "smooth", 0)
        within(self.robust, "robust", 0, 10, unit="K")

    @property
    def name(self) -> str:
        """Name of the method."""
        return name_of(self.method)

    def solver(self) -> Method:
        """The configured solver."""
        return solver(self.method, iterations=self.iterations, start=self.start, backend=self.backend, jobs=self.jobs)

    @property
    def ring(self) -> Guard | None:
        """The guard ring, if there is one."""
        return _term(self.guard, lambda margin: Guard(margin=margin))

    @property
    def means(self) -> Windows | Cells | None:
        """The windows or cells that are compared in place of control points, if there are any."""
        return pressure_means(self.fit)

    @property
    def quiet(self) -> tuple[QuietEars | QuietPalm, ...]:
        """The quiet terms that are on."""
        ears = _term(self.quiet_ears, lambda weight: QuietEars(weight=weight))
        palm = _term(self.quiet_palm, lambda weight: QuietPalm(weight=weight))
        return tuple(term for term in (ears, palm) if term is not None)

    @property
    def asked(self) -> frozenset[str]:
        """Names of the terms that are on."""
        on = {
            "amplitudes": self.amplitudes != "equal",
            "guard": bool(self.guard),
            "cells": self.means is not None,
            "smooth": self.smooth > 0,
            "robust": self.robust > 0,
            "quiet-ears": bool(self.quiet_ears),
            "quiet-palm": bool(self.quiet_palm),
        }
        return frozenset(name for name in on if on[name])

    def check(self) -> None:
        """Raise InputError if the method does not support a term, or two terms exclude each other."""
        if left := sorted(self.asked - takes(self.method)):
            able = [name for name in METHODS if takes(name) >= set(left)] + ["fit points"] * ("cells" in left)
            taken = ", ".join(sorted(takes(self.method))) or "none"
            raise InputError(
                f"method {self.name}: expected supported terms ({taken}), got {', '.join(left)}; "
                f"choose {' or '.join(able)}"
            )
        if {"robust", "cells"} <= self.asked:
            # They lose signal to distortion at every temperature of the range, see docs/air.md.
            raise InputError(
                "robust: expected fit points, as in the paper's mode, got windows or cells; leave robust out, and play "
                "with --correct-air"
            )

    def airs(self, acoustics: Acoustics) -> tuple[Acoustics, ...]:
        """The airs that are solved for at once, the nominal one first."""
        return airs_around(acoustics, self.robust) if self.robust else (acoustics,)

    def noted(self) -> dict[str, Setting]:
        """Settings of the terms for the provenance of a drive."""
        noted: dict[str, Setting] = {
            "amplitudes": self.amplitudes,
            "fit": self.fit if isinstance(self.fit, str) else type(self.fit).__name__.lower(),
            "smooth": self.smooth,
            "robust_c": self.robust,
            "quiet_ears": 0.0,
            "quiet_palm": 0.0,
        }
        for term in self.quiet:
            noted["quiet_ears" if isinstance(term, QuietEars) else "quiet_palm"] = term.weight
            if isinstance(term, QuietPalm) and term.outline:
                noted["quiet_palm_outline"] = term.outline
        ring = self.ring
        return noted if ring is None else noted | {f"guard_{one.name}": getattr(ring, one.name) for one in fields(ring)}
