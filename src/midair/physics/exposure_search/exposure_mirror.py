"""Search two ears at once in front of an array with mirror symmetry.

The path from a transducer to one ear is the mirror image of the path from the mirrored transducer to the other ear. So
the modes of both ears follow from sums and differences of the drives of mirrored transducers, with half the products,
and everything that belongs to the cube is computed once.
"""

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from midair.array_types import Array, Single
from midair.model import TransducerArray
from midair.physics.exposure_places import Place
from midair.physics.exposure_search.exposure_products import Product, Workspace

Complex = NDArray[np.complex64]
Indices = NDArray[np.intp]

SAME = 1e-6
"""Largest distance between a transducer and a mirror image that counts as the same, in m."""

APART = 1e-3
"""Largest distance between a place and the mirror image of another, in m; the common cube is larger by half of it."""

LONE = 0.05
"""Largest fraction of transducers without a mirror image."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """Two places that mirror each other, left and right of an array that does."""

    numbers: tuple[int, int]  # Indices of the places in their profile
    box: Place  # A cube that contains the one place, and the mirror image of the other
    array: TransducerArray  # The array, followed by the mirror images of transducers without one
    partner: Indices  # Index of the mirror image of each transducer of `array`
    middle: float  # x of the mirror, in m


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Halves:
    """From a drive to the modes of two places, by sums and differences of mirrored transducers."""

    order: Indices  # Order of the transducers: some, then their mirror images, then those without one
    pairs: int  # Number of transducers with a mirror image, counted once per pair
    common: Product  # From the sums to the modes
    different: Product  # From the differences to the modes

    @classmethod
    def of(cls, modes: Complex, partner: Indices, count: int) -> Self:
        """Make it from the modes (mode, transducer of `Pair.array`) of one place; `count` is the size of the real
        array.
        """
        own = np.arange(count)
        ahead = own[partner[:count] > own]
        ahead = ahead[partner[ahead] < count]
        lone = own[partner[:count] >= count]
        # Transducers on the mirror are their own image, and have equal weights for both sides.
        alone = np.concatenate([lone, own[partner[:count] == own]])
        one, other = modes[:, :count], modes[:, partner[:count]]
        kept = np.concatenate([ahead, alone])
        return cls(
            order=np.concatenate([ahead, partner[ahead], alone]),
            pairs=len(ahead),
            common=Product.of((one + other)[:, kept].T / 2),
            different=Product.of((one - other)[:, kept].T / 2),
        )

    def into(self, one: Single, other: Single, parts: Single, space: Workspace) -> None:
        """Compute the modes of both places into `one` and `other`, float32 (3, frame, mode).

        `parts` is float32 (3, frame, transducer) in `order`.
        """
        near, far, alone = np.split(parts, [self.pairs, 2 * self.pairs], axis=2)
        frames, width = parts.shape[1], self.pairs + alone.shape[2]
        combined, found = space.array("halves", 3, frames, width), space.array("half modes", 2, *one[:2].shape)
        combined[:, :, self.pairs :] = alone
        for combine, product, half in zip((np.add, np.subtract), (self.common, self.different), found, strict=True):
            combine(near, far, out=combined[:, :, : self.pairs])
            product.into(half, combined, space)
        for combine, modes in ((np.add, one), (np.subtract, other)):
            combine(found[0], found[1], out=modes[:2])
            np.add(modes[0], modes[1], out=modes[2])


def pair_of(places: tuple[Place, ...], array: TransducerArray) -> Pair | None:
    """The first two places that mirror each other before an array; None if there are none.

    Only enforced places with a cube, and arrays without a measured response, count.
    """
    cubes = [number for number, place in enumerate(places) if place.enforced and place.reach > 0]
    if not array.alike or len(cubes) < 2:
        return None
    middle = float(array.position[:, 0].min() + array.position[:, 0].max()) / 2
    for one, other in combinations(cubes, 2):
        here, there = (np.array(places[number].position) for number in (one, other))
        apart = mirrored(there, middle) - here
        if places[one].reach == places[other].reach and np.abs(apart).max() <= APART:
            completed = _completed(array, middle)
            if completed is None:
                return None
            x, y, z = (float(each) for each in here + apart / 2)
            reach = places[one].reach + float(np.abs(apart).max()) / 2
            box = replace(places[one], position=(x, y, z), reach=reach)
            return Pair(numbers=(one, other), box=box, array=completed[0], partner=completed[1], middle=middle)
    return None


def mirrored(points: Array, middle: float) -> Array:
    """Points mirrored at x = middle, shape (..., 3), in m."""
    return points * [-1, 1, 1] + [2 * middle, 0, 0]


def _completed(array: TransducerArray, middle: float) -> tuple[TransducerArray, Indices] | None:
    """An array with all its mirror images, and the index of each image; None if it is not nearly symmetric."""
    count, image = array.count, mirrored(array.position, middle)
    away, partner = cKDTree(array.position).query(image)
    partner = np.asarray(partner, np.intp)
    turned = array.normal * [-1, 1, 1]
    lone = np.flatnonzero((away > SAME) | (np.abs(array.normal[partner] - turned).max(axis=1) > SAME))
    if len(lone) > LONE * count:
        return None
    partner[lone] = count + np.arange(len(lone))
    partner = np.concatenate([partner, lone])
    if (partner[partner] != np.arange(len(partner))).any():  # two at one place
        return None
    whole = replace(
        array,
        position=np.concatenate([array.position, image[lone]]),
        normal=np.concatenate([array.normal, turned[lone]]),
        unit=np.zeros(0, np.int64),
        response=np.zeros(0, np.complex128),
    )
    return whole, partner
