"""What a worker writes: the chunks of its task, which nobody else touches."""

from dataclasses import dataclass, replace
from typing import Any

from midair.sweep.place import place_of
from midair.sweep.task import Found, Result, Task


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepAddress:
    """Where a worker finds the store of its sweep.

    Attributes
    ----------
    place : str
        Absolute folder, or address that fsspec knows.
    token : str
        Drawn when the store was made: a folder of the same name on another machine, or a store that was made again
        under the same name, is another one.
    """

    place: str
    token: str

    def take(self, result: Result) -> Result:
        """Store what a task found if the store is in reach of this machine; what is left to tell."""
        place = place_of(self.place)
        if result.found is None or not place.exists():
            return result
        group = place.group("r+")
        if group.attrs.get("token") != self.token:
            return result
        write_region(group, result.task, result.found, result.seconds)
        return replace(result, found=None)


def write_region(group: Any, task: Task, found: Found, seconds: float) -> None:
    """Numbers first, the flag last: killed in between, the task is done again, and only this one.

    Zarr puts each chunk into an object of its own, or into a file that it renames when it is whole.
    """
    error = group["error"]
    place = task.condition, task.first // error.chunks[1]
    error[task.condition, task.first : task.last] = found.error
    group["rounded_error"][task.condition, task.first : task.last] = found.rounded_error
    group["target_strength"][place] = found.strength
    group["seconds"][place] = seconds
    group["done"][place] = True
