"""Settings of a solution: those of the method, declared here, and one for each registered term."""

from dataclasses import dataclass, field, fields, make_dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

from midair.model import Acoustics, Setting
from midair.solvers.methods import Method, name_of
from midair.solvers.methods import solver as solver_of
from midair.solvers.problem import Start
from midair.solvers.terms import Term, registered_terms


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodSettings:
    """Settings of the method. `settings_type` adds a field for the keyword of each term."""

    method: str | Method = "exact"
    """A name in `METHODS`, or a configured solver such as ``Exact(tolerance=1e-3)``. "lm": Levenberg-Marquardt of the
    paper (4.2). "exact": the same steps in the modes of G above .5 % of the strongest, cheaper. "fast": batches of
    independent frames. "glide": whole recordings, by bisection in time. "free": an amplitude for
    each transducer, with little power. "live": less than a millisecond per frame.
    "naive", "gs", "wgs", "gs-pat", "greedy": published methods for comparison.
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
        return solver_of(
            self.method, iterations=self.iterations, start=self.start, backend=self.backend, jobs=self.jobs
        )

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
