"""Two ears before an array that is its own mirror image: what is worked out for one serves the other.

Sound goes from a transducer to one ear as it goes from the transducer's mirror image to the other. So the modes of both
ears follow from the sums and the differences of what two such transducers are told, in half the products, and all that
belongs to the cube is made once.
"""

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from midair.model import TransducerArray
from midair.physics.exposure_places import Place
from midair.physics.exposure_search.exposure_products import Product, Workspace

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex64]
Indices = NDArray[np.intp]

SAME = 1e-6
"""How far a mirror image may be from a transducer that it is taken for, in m."""

APART = 1e-3
"""How far a place may be from the mirror image of another, in m: by half of that a cube that holds both is larger."""

LONE = 0.05
"""Share of the transducers that may have no mirror image."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """Two places that mirror each other, left and right of an array that does.

    Attributes
    ----------
    numbers : tuple of two int
        Of the places in their profile.
    box : Place
        A cube that holds the one, and the mirror image of the other.
    array : TransducerArray
        With the mirror images of those transducers that had none, at the end.
    partner : ndarray of int, shape (transducer of `array`,)
        Which one is the mirror image of which.
    middle : float
        x of the mirror, in m.
    """

    numbers: tuple[int, int]
    box: Place
    array: TransducerArray
    partner: Indices
    middle: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Halves:
    """From a drive to the modes of two places, by what transducers that mirror each other have in common or not.

    Attributes
    ----------
    order : ndarray of int, shape (transducer,)
        In which the transducers are wanted: some, then the mirror images of these, then those that have none.
    pairs : int
        How many have one.
    common, different : Product
        From the sums, and from the differences, to the modes.
    """

    order: Indices
    pairs: int
    common: Product
    different: Product

    @classmethod
    def of(cls, modes: Complex, partner: Indices, count: int) -> Self:
        """From the modes of one of the places, shape (mode, transducer of `Pair.array`), for an array of a count."""
        own = np.arange(count)
        ahead = own[partner[:count] > own]
        ahead = ahead[partner[ahead] < count]
        lone = own[partner[:count] >= count]
        # Those on the mirror itself are their own image, and weigh the same on both sides.
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
        """Work out the modes of both places.

        Parameters
        ----------
        one, other : ndarray of float32, shape (3, frame, mode)
            Where their real parts, imaginary parts and sums of both go.
        parts : ndarray of float32, shape (3, frame, transducer)
            The same of the drive, in `order`.
        space : Workspace
            For what is between.
        """
        near, far, alone = np.split(parts, [self.pairs, 2 * self.pairs], axis=2)
        frames, width = parts.shape[1], self.pairs + alone.shape[2]
        told, found = space.array("halves", 3, frames, width), space.array("half modes", 2, *one[:2].shape)
        told[:, :, self.pairs :] = alone
        for combine, product, half in zip((np.add, np.subtract), (self.common, self.different), found, strict=True):
            combine(near, far, out=told[:, :, : self.pairs])
            product.into(half, told, space)
        for combine, modes in ((np.add, one), (np.subtract, other)):
            combine(found[0], found[1], out=modes[:2])
            np.add(modes[0], modes[1], out=modes[2])


def pair_of(places: tuple[Place, ...], array: TransducerArray) -> Pair | None:
    """The first two places that mirror each other before an array; None where there are none.

    A place of which only points are looked at is none of them, and neither is one of an array that was measured:
    its transducers are no longer alike.
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
    """Points on the other side of a mirror, shape (..., 3), in m."""
    return points * [-1, 1, 1] + [2 * middle, 0, 0]


def _completed(array: TransducerArray, middle: float) -> tuple[TransducerArray, Indices] | None:
    """An array with all its mirror images, and which is whose; None where it is not nearly its own."""
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
