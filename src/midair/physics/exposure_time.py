"""The loudest sound at a place while frames arrive: an ear hears near transducers already with the next frame.

Transducers are grouped by the time at which their sound arrives at the middle of a place. At each moment each group
sounds with the frame that has arrived from it. The modes of such a mix are sums of the modes of groups, so that moments
cost little. The field is searched for one moment of each frame, and for those others that can be louder: the difference
of the modes bounds that of the field.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import ceil

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Single
from midair.physics.exposure_modes import Product, Workspace
from midair.physics.exposure_search import CubeSearch, PointSearch

SLOT = 31.25e-6
"""Longest time in s from the first to the last arrival of a group of transducers."""

MOMENTS = 125e-6
"""Longest time between two moments in s; there are at least two moments in a frame."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TimeSearch:
    """Computes the loudest moments at a place while the frames of a drive arrive.

    `parts` are those of `drive_parts` with frames last, float32 (3, transducer, reach + frame): the frames, and those
    that sound beside the first of them.
    """

    search: CubeSearch | PointSearch
    groups: tuple[tuple[NDArray[np.intp], Product], ...]
    """Transducers whose sound is 0, 1, 2 ... slots late, and the product from them to the modes."""
    slots: int
    """Slots in a frame, of one group after the other."""
    every: int
    """Slots from one moment to the next."""
    squares: Single
    """Squared weights of the modes, shape (mode,), in Pa2."""

    @property
    def reach(self) -> int:
        """Number of earlier frames that sound beside a frame."""
        return max(1, ceil(len(self.groups) / self.slots))

    def last_moments(self, parts: Single, space: Workspace) -> tuple[Array, Array]:
        """Amplitude at the last moment of each frame, shape (air, frame), and the most that it is exceeded before.

        The excess (frame,) is above the louder of this and the last moment of the frame before; both in Pa.
        """
        groups, excess = self._groups(parts, space), np.zeros(parts.shape[2] - self.reach)
        for _, apart in self._moments(groups, space):
            np.maximum(excess, apart, out=excess)
        end = self._at_end(groups, 0, space.array("end", 3, len(excess), groups.shape[3]))
        return self._amplitude(end, space), excess

    def other_moments(self, parts: Single, below: Array, loudest: float, space: Workspace) -> Array:
        """Amplitude at the loudest moment before the last one of each frame, shape (air, frame), in Pa.

        It is 0 for moments that cannot exceed `loudest`; `below` (frame,) is the louder of the last moments of the
        frame and of the one before, in Pa.
        """
        found = np.zeros((self.search.airs, len(below)))
        for mixed, apart in self._moments(self._groups(parts, space), space):
            some = np.flatnonzero(below + apart > loudest)
            if len(some):
                found[:, some] = np.maximum(found[:, some], self._amplitude(np.take(mixed, some, axis=1), space))
        return found

    def _groups(self, parts: Single, space: Workspace) -> Single:
        """Modes of each group, float32 (group, 2, reach + frame, mode)."""
        frames, width = parts.shape[2], self.groups[0][1].width
        groups = space.array("groups", len(self.groups), 2, frames, width)
        for (members, product), into in zip(self.groups, groups, strict=True):
            own = space.array("members", 3, len(members), frames)
            product.into(into, np.take(parts, members, axis=1, out=own, mode="clip").transpose(0, 2, 1), space)
        return groups

    def _moments(self, groups: Single, space: Workspace) -> Iterator[tuple[Single, Array]]:
        """The modes at each moment before the last of every frame, with room for their sum, (3, frame, mode), and the
        bound of their distance from a mean of the last moments of this frame and of the one before, (frame,), in Pa.
        """
        shape = (3, groups.shape[2] - self.reach, groups.shape[3])
        end, before, mixed, rest = (space.array(name, *shape) for name in ("end", "before", "mixed", "rest"))
        self._at_end(groups, 0, end)
        mixed[:] = self._at_end(groups, 1, before)
        count, arrived = len(self.groups), 0
        for slot in range(min(self.slots, count) - 1):
            for group in range(slot, count, self.slots):
                late = (group - slot) // self.slots
                mixed[:2] += self._late(groups, group, late)
                mixed[:2] -= self._late(groups, group, late + 1)
                arrived += len(self.groups[group][0])
            if (slot + 1) % self.every:
                continue
            share = np.float32(arrived / sum(len(members) for members, _ in self.groups))
            np.subtract(mixed[:2], share * end[:2], out=rest[:2])
            rest[:2] -= (1 - share) * before[:2]
            np.square(rest[:2], out=rest[:2])
            yield mixed, np.sqrt((rest[0] + rest[1]) @ self.squares)

    def _late(self, groups: Single, group: int, late: int) -> Single:
        """Modes of a group that sounds with a frame this number of frames ago, (2, frame, mode)."""
        first = self.reach - late
        return groups[group, :, first : first + groups.shape[2] - self.reach]

    def _at_end(self, groups: Single, late: int, out: Single) -> Single:
        """Modes at the last moment of each frame, or of one that is earlier by `late` frames, written into `out`."""
        out[:2] = 0
        for group in range(len(self.groups)):
            out[:2] += self._late(groups, group, late + max(0, ceil((group + 1) / self.slots) - 1))
        return out

    def _amplitude(self, modes: Single, space: Workspace) -> Array:
        np.add(modes[0], modes[1], out=modes[2])
        return self.search.loudest(modes, space)


@lru_cache(maxsize=32)
def time_search(search: CubeSearch | PointSearch, rate: float) -> TimeSearch:
    """The search of a place for frames at `rate` in Hz."""
    slots = ceil(1 / (rate * SLOT))
    late = np.rint(search.delay * rate * slots).astype(np.intp)
    members = [np.flatnonzero(late == slot) for slot in range(late.max() + 1)]
    groups = tuple((each, Product.of(search.modes[:, each].T)) for each in members)
    squares = np.square(search.weights).astype(np.float32)
    every = max(1, int(min(MOMENTS, 0.5 / rate) * rate * slots))
    return TimeSearch(search=search, groups=groups, slots=slots, every=every, squares=squares)
