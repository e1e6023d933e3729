"""The solvers by name, the check of the terms that each of them supports, and the settings of a solution."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, make_dataclass, replace
from functools import cache
from numbers import Integral
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from midair.errors import InputError
from midair.model import Acoustics, Setting
from midair.solvers.exact import Exact
from midair.solvers.fast import Fast
from midair.solvers.free import Free
from midair.solvers.glide import Glide
from midair.solvers.levenberg_marquardt import LevenbergMarquardt
from midair.solvers.live import Live
from midair.solvers.problem import Start
from midair.solvers.terms import Term, registered_terms

Method = LevenbergMarquardt | Exact | Fast | Glide | Free | Live

METHODS: Mapping[str, Callable[[], Method]] = MappingProxyType(
    {
        "lm": LevenbergMarquardt,
        "exact": Exact,
        "fast": Fast,
        "glide": Glide,
        "free": Free,
        "live": Live,
    }
)
"""Name and constructor of each method."""


def takes(method: str | Method) -> frozenset[str]:
    """Names of the terms that a method supports besides the error of the paper."""
    return frozenset(term.shown() for term in registered_terms().values() if name_of(method) in term.methods)


def check_terms(method: str | Method, asked: Iterable[str]) -> None:
    """Raise InputError if the method does not support one of these terms."""
    method = name_of(method)
    left = sorted(set(asked) - takes(method))
    if left:
        able = [name for name in METHODS if takes(name) >= set(left)]
        able += [term.instead for term in registered_terms().values() if term.instead and term.shown() in left]
        taken = ", ".join(sorted(takes(method))) or "none"
        raise InputError(
            f"method {method}: expected supported terms ({taken}), got {', '.join(left)}; choose {' or '.join(able)}"
        )


def name_of(method: str | Method) -> str:
    """The name in `METHODS` of a configured solver; a name is returned unchanged.

    Raises InputError if the argument is neither a name nor a solver of `METHODS`.
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
    """The solver of this name, or the given solver, with other settings where the method has them.

    `method` is a name in `METHODS`, or a solver such as ``Fast(iterations=60)``. `iterations` is the maximum for every
    frame, or for frames that start at zero and frames that start at the previous one; `start` ("previous", "zero") that
    of every frame after the first; `backend` the array library of "fast" and "glide", see `backend.backend`; `jobs` the
    number of worker threads of "glide". Methods without a start or jobs ignore them. Raises InputError if the method or
    the start is unknown; if iterations are below 1, are given to "glide" (which has its own for each kind of frame), or
    are two numbers for a method that has one; if a backend is given to a method that has none.
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
            raise InputError(f"backend: expected method fast or glide, got {name}; the others run on NumPy or Numba")
        changes["backend"] = backend
    if jobs is not None and "jobs" in has:
        changes["jobs"] = jobs
    if iterations is not None and name == "glide":
        raise InputError("iterations: expected none with glide; set the iterations of each kind of frame in Glide(...)")
    if iterations is not None:
        changes |= _iterations(name, iterations, "warm_iterations" in has)
    return replace(settings, **changes)


def _iterations(method: str, iterations: int | tuple[int, int], warm: bool) -> dict[str, int]:
    first, later = iterations if isinstance(iterations, tuple) else (iterations, iterations)
    if not all(isinstance(each, Integral) and each >= 1 for each in (first, later)):
        raise InputError(f"iterations: expected 1 or more, got {iterations!r}")
    if warm:
        return {"iterations": first, "warm_iterations": later}
    if first != later:
        raise InputError(f"iterations: expected one number, since {method} solves all frames alike, got {iterations}")
    return {"iterations": first}


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodSettings:
    """Settings of the method. `settings_type` adds a field for the keyword of each term."""

    method: str | Method = "exact"
    """A name in `METHODS`, or a configured solver such as ``Exact(tolerance=1e-3)``. "lm": Levenberg-Marquardt of the
    paper (4.2). "exact": the same steps in the modes of G above .5 % of the strongest, cheaper. "fast": batches of
    independent frames. "glide": whole recordings, by bisection in time. "free": an amplitude for
    each transducer, with little power. "live": less than a millisecond per frame.
    """
    iterations: int | tuple[int, int] | None = None
    """Maximum iterations for every frame, or for frames that start at zero and frames that start at the previous frame;
    the method's own if None (lm: 50 and 20; 5.2).
    """
    start: Start | None = None
    """Start of every frame after the first, "previous" or "zero" (4.2), which makes frames independent; "lm" and
    "exact" alone have this choice. The solver's own, "previous" unless configured, if None.
    """
    level: float | Literal["auto"] = 1.0
    """Drive of every transducer, above 0 to 1: the equal amplitude A (4.2). "auto" takes what the loudest frame needs,
    see `automatic_level`. Silent frames get 0.
    """
    backend: str | None = None
    """Array library of methods "fast" and "glide": "numpy", "torch", "torch:cuda", "cupy"; NumPy if None."""
    jobs: int | None = field(default=None, compare=False)
    """Number of blocks that method "glide" solves at once, 1 if None; it does not affect the result."""

    if TYPE_CHECKING:

        def __init__(self, **settings: Any) -> None: ...

        def __getattr__(self, name: str) -> Any: ...

    @property
    def name(self) -> str:
        """Name of the method."""
        return name_of(self.method)

    def solver(self) -> Method:
        """The configured solver."""
        return solver(self.method, iterations=self.iterations, start=self.start, backend=self.backend, jobs=self.jobs)

    def terms(self) -> tuple[Term, ...]:
        """The terms that are on; InputError if a value is out of range."""
        made = (term.of(getattr(self, keyword)) for keyword, term in registered_terms().items())
        return tuple(term for term in made if term is not None)

    @property
    def asked(self) -> frozenset[str]:
        """Names of the terms that are on."""
        return frozenset(term.shown() for term in self.terms())

    def airs(self, acoustics: Acoustics) -> tuple[Acoustics, ...]:
        """The airs that are solved for at once, the nominal one first."""
        airs = (acoustics,)
        for term in self.terms():
            airs = term.airs(airs)
        return airs

    def noted(self) -> dict[str, Setting]:
        """Settings of the terms for the provenance of a drive."""
        return {
            name: value
            for keyword, term in registered_terms().items()
            for name, value in term.noted(getattr(self, keyword)).items()
        }

    def __reduce__(self) -> tuple[Any, ...]:
        """The class of `settings_type` is not in a module, so that pickle makes it again."""
        return _made, ({one.name: getattr(self, one.name) for one in fields(self)},)


@cache
def settings_type() -> type[MethodSettings]:
    """The dataclass with a field for each setting of the method and each registered term."""
    terms = registered_terms().items()
    made = [(keyword, term.setting(), field(default=term.default)) for keyword, term in terms]
    return make_dataclass(
        "SolverSettings",
        made,
        bases=(MethodSettings,),
        namespace={
            "__doc__": "Settings of the solver, from target to drive: of the method, and of each term.",
            "__module__": __name__,
        },
        frozen=True,
        slots=True,
        kw_only=True,
    )


def _made(values: dict[str, Any]) -> MethodSettings:
    return settings_type()(**values)
