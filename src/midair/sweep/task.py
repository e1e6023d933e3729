"""Parts of a sweep: conditions times items, divided into tasks."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

from numpy.typing import NDArray

from midair.array_types import Array


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
    """Result of a job: E with exact and with rounded phases, shape (item,), and the strength of the targets."""

    error: Array
    rounded_error: Array
    strength: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """Result of a task with its processor time in s; `found` is None if the worker has stored it."""

    task: Task
    found: Found | None
    seconds: float


Job = Callable[[], Found]
"""A task with all its data; it is sent to a worker and called there."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coordinate:
    """Array along axes of the results, stored as `name`; `axes` are ``condition``, the name of the items, or both."""

    name: str
    axes: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, Any]


def settings_of(thing: Any) -> Any:
    """Convert settings to JSON values: objects to mappings, tuples to lists, other types to strings."""
    if is_dataclass(thing) and not isinstance(thing, type):
        return {field.name: settings_of(getattr(thing, field.name)) for field in fields(thing)}
    if isinstance(thing, Mapping):
        return {str(name): settings_of(each) for name, each in thing.items()}
    if isinstance(thing, list | tuple):
        return [settings_of(each) for each in thing]
    return thing if thing is None or isinstance(thing, str | int | float) else str(thing)
