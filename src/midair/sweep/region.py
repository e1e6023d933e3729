"""Storage of a task's chunks by the worker that solved it; no other process writes them."""

from dataclasses import dataclass, replace
from typing import Any

from midair.sweep.storage import storage_of
from midair.sweep.task import Found, Result, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepAddress:
    """Location of the store for workers."""

    place: str
    """Absolute folder, or address for fsspec."""
    token: str
    """Random token; differs for a store of the same name on another machine, and for a new store."""

    def take(self, result: Result) -> Result:
        """Store the result of a task if this machine can access the store; return what is still to be stored."""
        place = storage_of(self.place)
        if result.found is None or not place.exists():
            return result
        group = place.group("r+")
        if group.attrs.get("token") != self.token:
            return result
        write_region(group, result.task, result.found, result.seconds)
        return replace(result, found=None)


def write_region(group: Any, task: Task, found: Found, seconds: float) -> None:
    """Write the numbers, then the flag, so that after a crash in between only this task is repeated.

    Zarr writes each chunk to its own object, or to a file that it renames when it is complete.
    """
    error = group["error"]
    place = task.condition, task.first // error.chunks[1]
    error[task.condition, task.first : task.last] = found.error
    group["rounded_error"][task.condition, task.first : task.last] = found.rounded_error
    group["target_strength"][place] = found.strength
    group["seconds"][place] = seconds
    group["done"][place] = True
