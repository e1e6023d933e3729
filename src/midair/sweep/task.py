"""What any sweep is to those who run and store it: conditions times items, cut into tasks."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from midair.model import Provenance

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Items `first` to `last` - 1 of one condition, solved together."""

    condition: int
    first: int
    last: int

    @property
    def count(self) -> int:
        """Number of items."""
        return self.last - self.first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """What a job found.

    Attributes
    ----------
    error, rounded_error : ndarray, shape (item,)
        E, and E of rounded phases.
    strength : float
        Highest peak of the targets over the focus of the whole array.
    """

    error: Array
    rounded_error: Array
    strength: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """What came of a task.

    Attributes
    ----------
    task : Task
        The task.
    found : Found or None
        None where the worker has stored it.
    seconds : float
        Processor time that it took, in s.
    """

    task: Task
    found: Found | None
    seconds: float


class Job(Protocol):
    """A task with all that it needs; goes to a worker, and is called there."""

    def __call__(self) -> Found:
        """Solve the task, and give its errors."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coordinate:
    """What stands along an axis of the results.

    Attributes
    ----------
    name : str
        Name of the array in the store.
    axes : tuple of str
        ``condition``, the name of the items, or both.
    values : ndarray
        Numbers or texts, as many as the axes are long.
    attributes : mapping
        Such as units.
    """

    name: str
    axes: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, Any]


class Sweep(Protocol):
    """A sweep: E of each item under each condition.

    Attributes
    ----------
    kind : str
        ``patterns`` or ``recordings``.
    item : str
        What the second axis counts: ``pattern``, ``frame`` or ``place``.
    """

    @property
    def kind(self) -> str:
        """Name of the kind."""
        ...

    @property
    def item(self) -> str:
        """Name of what the second axis counts."""
        ...

    @property
    def chunk(self) -> int:
        """Most items a task."""
        ...

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of conditions and of items."""
        ...

    def tasks(self) -> tuple[Task, ...]:
        """The whole work, in the order in which it is begun."""
        ...

    def job(self, task: Task) -> Job:
        """What a worker is given."""
        ...

    def coordinates(self) -> tuple[Coordinate, ...]:
        """What is stored along the axes."""
        ...

    def settings(self) -> dict[str, Any]:
        """Everything that the results depend on, as JSON knows it."""
        ...

    def provenance(self) -> Provenance:
        """Where the results come from."""
        ...


def settings_of(thing: Any) -> Any:
    """What JSON would give back of settings: objects as mappings, lists for tuples, texts for what it does not know."""
    if is_dataclass(thing) and not isinstance(thing, type):
        return {field.name: settings_of(getattr(thing, field.name)) for field in fields(thing)}
    if isinstance(thing, Mapping):
        return {str(name): settings_of(each) for name, each in thing.items()}
    if isinstance(thing, list | tuple):
        return [settings_of(each) for each in thing]
    return thing if thing is None or isinstance(thing, str | int | float) else str(thing)
