"""The interface of the terms that a solver can add to the error of the paper, and their registry.

A term is one class in one file and one entry of `TERMS`. Its keyword in `midair.solve`, its option, its place in
`Settings`, the provenance of drives, the documentation and the estimate of memory are derived from the class.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import cache
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Acoustics, ControlGrid, Setting, TransducerArray
from midair.physics import transfer_matrix
from midair.solvers.backend import Numbers, Rows

if TYPE_CHECKING:
    from midair.solvers.problem import Answer, Problem
    from midair.solvers.solve_plan import NormalisedSetup

Places = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Term(ABC):
    """A term of the objective: the class describes its setting, an instance is a term that is switched on.

    A subclass is a frozen dataclass; the setting is a number, which becomes its first field, or an instance.
    """

    __slots__ = ()
    keyword: ClassVar[str]
    """Its keyword in `midair.solve`; the option has dashes for underscores."""
    help: ClassVar[str]
    """Help text of the option: one sentence or noun phrase."""
    methods: ClassVar[frozenset[str]]
    """Methods that support the term, names in `METHODS`."""
    unit: ClassVar[str] = ""
    """SI unit of the number; empty for plain numbers and names."""
    limits: ClassVar[tuple[float, float, str]] = (0.0, np.inf, "0 or more")
    """Smallest and largest number, and both in words."""
    default: ClassVar[Any] = 0.0
    """Value that switches the term off."""
    values: ClassVar[Any] = float
    """Type of the values that can be typed."""
    name: ClassVar[str] = ""
    """Name in error messages, if it differs from that of the option."""
    instead: ClassVar[str] = ""
    """Words that switch the term off, where a message should suggest them."""
    path: ClassVar[str] = ""
    """Place of the option's number in `SolverSettings`, if it is a field of the term."""
    copies: ClassVar[int] = 1
    """Unknown phases for each transducer."""

    @classmethod
    def option(cls) -> str:
        """Name of the option."""
        return cls.keyword.replace("_", "-")

    @classmethod
    def shown(cls) -> str:
        """Name in error messages."""
        return cls.name or cls.option()

    @classmethod
    def setting(cls) -> Any:
        """Type of the setting."""
        return cls.values | cls

    @classmethod
    def of(cls, value: Any) -> "Term | None":
        """The term for a value of the setting, None if it is off; InputError if the value is out of range."""
        if isinstance(value, cls):
            return value
        low, high, words = cls.limits
        if not (low <= value <= high and value < np.inf):
            raise InputError(f"{cls.keyword}: expected {words}, got {value:g}")
        return cls(**{cls._main(): value}) if value > 0 else None

    @classmethod
    def number(cls, value: Any) -> Any:
        """Value of the option for a value of the setting."""
        return getattr(value, cls._main()) if isinstance(value, cls) else value

    @classmethod
    def with_number(cls, value: Any, number: Any) -> Any:
        """The value of the setting after the option has set its number; 0 switches the term off."""
        made: Any = value
        return replace(made, **{cls._main(): number}) if isinstance(value, cls) and number else number

    @classmethod
    def noted(cls, value: Any) -> dict[str, Setting]:
        """Entries of the provenance of a drive."""
        return {cls.keyword: cls.number(value)}

    @classmethod
    def _main(cls) -> str:
        made: Any = cls
        return fields(made)[0].name

    def airs(self, airs: tuple[Acoustics, ...]) -> tuple[Acoustics, ...]:
        """The airs that are solved for at once; the first is the nominal one."""
        return airs

    def added(self, problem: "Problem", setup: "NormalisedSetup") -> "Problem":  # noqa: ARG002
        """The problem with this term; `setup` has the matrices of all airs."""
        return problem

    def asked(self, problem: "Problem") -> "Problem":
        """The problem that the method solves in place of this one."""
        return problem

    def answered(self, answer: "Answer") -> "Answer":
        """The answer to a problem from the answer to `asked` of it."""
        return answer

    def quiet_rows(self, grid: ControlGrid) -> int:  # noqa: ARG002
        """Number of points outside the control grid that the term adds, for the estimate of memory."""
        return 0


class QuietTerm(Term):
    """Places outside the control grid where the mean square of the sound shall be low: ``lambda M mean |p|^2 / 2``.

    A subclass has a field `weight`, lambda, and `points`.
    """

    __slots__ = ()
    methods = frozenset({"lm", "fast", "glide", "free"})
    weight: float

    def points(self, grid: ControlGrid) -> Places:
        """The places, shape (point, 3), in m; a term that defines `rows` and `quiet_rows` has none."""
        raise NotImplementedError

    def rows(self, grid: ControlGrid, array: TransducerArray, acoustics: Acoustics) -> Complex:
        """Rows (row, transducer) in Pa whose squared fields add up to the mean of ``|p|^2`` over the points."""
        points = self.points(grid)
        return transfer_matrix(points, array, acoustics=acoustics) / np.sqrt(len(points))

    def added(self, problem: "Problem", setup: "NormalisedSetup") -> "Problem":
        """The problem with the rows of the term below those of the guard."""
        rows = np.concatenate([self.rows(setup.target.grid, setup.array, each) for each in setup.airs])
        # The error is a sum over M control points, so a mean over other places is multiplied by M.
        count = np.sqrt(len(setup.G[0])) / setup.focus
        return problem.with_quiet(count * rows, self.weight)

    def quiet_rows(self, grid: ControlGrid) -> int:
        """Number of points."""
        return len(self.points(grid))


class PhaseTerm(Term):
    """A cost of the phases of successive frames, such as that of their changes."""

    __slots__ = ()
    methods = frozenset({"fast"})

    @abstractmethod
    def cost(self, xp: Any, q: Rows, before: Rows) -> tuple[Numbers, Rows]:
        """The cost of each row (row,), beside E^2 / 2, and the gradient of their sum by the phases (row, transducer).

        q (row, transducer) are drives of magnitude 1 in order of time; `before` (1, transducer) is the fixed drive
        before the first, 0 if there is none. `xp` has the functions of the array API standard.
        """

    def added(self, problem: "Problem", setup: "NormalisedSetup") -> "Problem":  # noqa: ARG002
        """The problem with this cost."""
        return replace(problem, costs=(*problem.costs, self))


TERMS = {
    "amplitudes": "midair.solvers.terms.amplitudes:Bounded",
    "guard": "midair.solvers.terms.guard:Guard",
    "fit": "midair.solvers.terms.fit:PressureMeans",
    "smooth": "midair.solvers.terms.smooth:Smooth",
    "robust": "midair.solvers.terms.temperatures:Robust",
    "quiet_ears": "midair.solvers.terms.quiet_ears:QuietEars",
    "quiet_palm": "midair.solvers.terms.quiet_palm:QuietPalm",
}
"""The terms by keyword, in the order in which they are added to a problem; their modules import this one."""


@cache
def registered_terms() -> Mapping[str, type[Term]]:
    """The terms by keyword."""
    return {keyword: resolve_name(term) for keyword, term in TERMS.items()}
