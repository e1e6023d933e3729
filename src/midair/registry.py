"""Objects that are imported by name when they are first used: the kinds of sensors, arrays and file formats."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from midair.errors import MissingExtraError

T = TypeVar("T")


def load_object(name: str, value: str) -> Any:
    """Import an object of midair, "module:object [extra]"; MissingExtraError if a package that it needs is missing."""
    return _load(EntryPoint(name, value, ""), "midair")


class Registry(Mapping[str, T], Generic[T]):
    """Objects by name: those of midair, then those of other packages. Each is imported when it is first read.

    A package adds an object by an entry point of the group, in its pyproject.toml::

        [project.entry-points."midair.sensors"]
        udp = "my_package.udp:UdpSensor [fast]"

    `group` is that of the entry points, such as "midair.sensors"; `own` are the objects of midair by name, as
    "module:object [extra]", which other packages cannot replace.
    """

    def __init__(self, group: str, own: Mapping[str, str]) -> None:
        self.group, self._own = group, own

    @cached_property
    def _others(self) -> dict[str, EntryPoint]:
        return {entry.name: entry for entry in entry_points(group=self.group) if entry.name not in self._own}

    @property
    def others(self) -> tuple[str, ...]:
        """Names of the objects of other packages."""
        return tuple(self._others)

    def __iter__(self) -> Iterator[str]:
        yield from self._own
        yield from self._others

    def __len__(self) -> int:
        return len(self._own) + len(self._others)

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self._others

    def __getitem__(self, name: str) -> T:
        """Import the object of a name.

        Raises KeyError if nothing has the name; MissingExtraError if a package or a library that it needs is missing.
        """
        if name in self._own:
            return load_object(name, self._own[name])
        entry = self._others[name]
        return _load(entry, "midair" if entry.dist is None else entry.dist.name)

    def __repr__(self) -> str:
        return f"<Registry {self.group}: {', '.join(self)}>"


def _load(entry: EntryPoint, owner: str) -> Any:
    name = entry.name
    try:
        return entry.load()
    except ModuleNotFoundError as wrong:
        extra = f"{owner}[{','.join(entry.extras)}]" if entry.extras else str(wrong.name)
        raise MissingExtraError(
            f'{name}: expected the package {wrong.name}, it is not installed; pip install "{extra}"'
        ) from wrong
    except (ImportError, AttributeError, OSError, RuntimeError) as wrong:
        reason = (str(wrong).splitlines() or [type(wrong).__name__])[0]
        raise MissingExtraError(f"{name}: expected {entry.value}, got: {reason}") from wrong
