"""Registries of sensors, arrays, motion stages and file formats, which installed packages extend by entry points."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from midair.errors import MissingExtraError

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """Objects by name: those of midair, then those of other packages. Each is imported when it is first read.

    A package adds an object by an entry point of the group, in its pyproject.toml::

        [project.entry-points."midair.sensors"]
        udp = "my_package.udp:UdpSensor [fast]"

    `group` is that of the entry points, such as "midair.sensors"; `own` are the objects of midair by name, as
    "module:object [extra]", which other packages cannot replace.
    """

    def __init__(self, group: str, own: Mapping[str, str]) -> None:
        self.group = group
        self._own = {name: EntryPoint(name, value, group) for name, value in own.items()}

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
        entry = self._own.get(name) or self._others[name]
        try:
            return entry.load()
        except ModuleNotFoundError as wrong:
            owner = "midair" if name in self._own or entry.dist is None else entry.dist.name
            extra = f"{owner}[{','.join(entry.extras)}]" if entry.extras else str(wrong.name)
            raise MissingExtraError(
                f'{name}: expected the package {wrong.name}, it is not installed; pip install "{extra}"'
            ) from wrong
        except (ImportError, AttributeError, OSError, RuntimeError) as wrong:
            reason = (str(wrong).splitlines() or [type(wrong).__name__])[0]
            raise MissingExtraError(f"{name}: expected {entry.value}, got: {reason}") from wrong

    def __repr__(self) -> str:
        return f"<Registry {self.group}: {', '.join(self)}>"
