"""What all transducers share when they are measured: where the sensor lies, how soft its gel is, how strong they are.

A sensor that lies elsewhere makes transducers late in a pattern, and a softer gel makes those weak that come from the
side. A fit of each transducer cannot tell that from transducers that differ so; what can is that they differ at random.
So both are found twice: by Gauss and Newton with transducers that are alike, and from what the transducers' own phases
and strengths have in common with the patterns. How sure that is belongs to the uncertainty of each.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.calibration.measure.array_field import ArrayField, SensorPlace
from midair.errors import InputError

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

DEAD = 0.1
"""Part of the usual strength below which a transducer is dead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransducerPrior:
    """What is believed of a transducer before it is measured, as standard deviations.

    Attributes
    ----------
    response : float
        Of real and imaginary part, as a part of the mean strength.
    pole : float
        Of real and imaginary part, as a part of one over the time constant.
    length : float
        Of where the sensor lies, in m.
    softness : float
        Of the standard deviation with which the gel spreads a point, in m.
    """

    response: float = 0.3
    pole: float = 0.2
    length: float = 3e-3
    softness: float = 0.5e-3


@dataclass(slots=True, eq=False)
class ArrayState:
    """What is known so far, shape (transducer,) each."""

    response: Complex
    pole: Complex
    place: SensorPlace


def said_of(field: ArrayField, group: int, state: ArrayState, q: Complex | None = None) -> Complex:
    """What the model says of a group's window, shape (bin, cell); `q` is what the group radiates, if it is known."""
    G, weights = field.matrix(state.place)
    members = field.codes.groups[group]
    sound = sound_of(field, group, state, G, field.followed(group, state.pole[members])[0] if q is None else q)
    return field.predicted(np.abs(sound) ** 2 @ weights.T, group, state.place)


def sound_of(field: ArrayField, group: int, state: ArrayState, G: Complex, q: Complex) -> Complex:
    """Sound at the points at every moment, shape (moment, point), of what each of the group radiates and the rest."""
    members = field.codes.groups[group]
    still = field.codes.level * np.exp(1j * field.codes.still) * state.response
    still[members] = 0
    return G @ still + q @ (G[:, members] * state.response[members]).T


def find_place(
    field: ArrayField, heard: Complex, state: ArrayState, usual: TransducerPrior, *, synchronous: bool
) -> None:
    """Gauss and Newton over what all transducers share, by what the first group's codes told."""
    steps = {"x": 2e-5, "y": 2e-5, "z": 2e-5, "turn": 1e-3, "late": 1e-6, "gain": 1e-3, "spread": 2e-5}
    wide = {"turn": 0.1, "late": 1e-12 if synchronous else 1e-3, "gain": 2.0, "spread": usual.softness}
    belief = np.array([wide.get(name, usual.length) / step for name, step in steps.items()])
    q = field.followed(0, state.pole[field.codes.groups[0]])[0]
    moved = np.zeros(len(steps))
    for _ in range(6):
        now = said_of(field, 0, state, q)
        rest = heard - now
        slope = np.empty((2 * rest.size, len(steps)))
        for column, (name, step) in enumerate(steps.items()):
            place = replace(state.place, **{name: getattr(state.place, name) + step})
            changed = said_of(field, 0, ArrayState(state.response, state.pole, place), q)
            slope[:, column] = real_parts((changed - now).ravel())
        error = float(np.square(real_parts(rest.ravel())).mean())
        information = slope.T @ slope / error + np.diag(1 / belief**2)
        change = np.linalg.solve(information, slope.T @ real_parts(rest.ravel()) / error - moved / belief**2)
        moved += change
        values = {
            name: getattr(state.place, name) + float(part) * step
            for (name, step), part in zip(steps.items(), change, strict=True)
        }
        values["gain"] = max(values["gain"], 0.1 * state.place.gain)
        values["spread"] = float(np.clip(values["spread"], 0.6e-3, 3e-3))
        state.place = replace(state.place, **values)
        if np.abs(change[:3]).max() < 0.05:
            break
    told = 1 - float(np.square(np.abs(heard - said_of(field, 0, state))).sum() / np.square(np.abs(heard)).sum())
    if told < 0.5:
        raise InputError(
            f"array: expected the sensor to hear what the model says, got {100 * max(told, 0):.0f} % of it; is it over "
            "the centre of the array, at that height, with this calibration?"
        )


def _patterns(field: ArrayField, place: SensorPlace) -> Array:
    """How much later each transducer is where a sensor lies 1 m further along x, y, z, in rad; and 1 for all."""
    way = np.array([place.x, place.y, place.z]) - field.array.position
    k = 2 * np.pi * field.array.frequency / field.acoustics.medium.speed
    return np.column_stack([k * way / np.linalg.norm(way, axis=1, keepdims=True), np.ones(len(way))])


def settle_place(field: ArrayField, state: ArrayState, strength: float, usual: TransducerPrior) -> None:
    """Take what looks like another place of the sensor out of the phases: transducers do not know where it lies.

    The sound at the sensor stays what it is, to first order.
    """
    pattern = _patterns(field, state.place)
    alive = np.abs(state.response) > DEAD * strength
    phase = np.angle(state.response * np.exp(-1j * np.angle(state.response[alive].sum())))
    belief = np.diag([float(np.var(phase[alive])) / usual.length**2] * 3 + [0.0])
    moved = np.linalg.solve(pattern[alive].T @ pattern[alive] + belief, pattern[alive].T @ phase[alive])
    x, y, z = (float(each) for each in moved[:3])
    state.response = state.response * np.exp(-1j * (pattern[:, :3] @ moved[:3]))
    soft = _softness(field, state)
    size = np.abs(state.response) / np.abs(state.response[alive]).mean() - 1
    about = soft - soft[alive].mean()
    change = float(about[alive] @ size[alive] / (about[alive] @ about[alive] + np.var(size[alive]) / usual.softness**2))
    place = state.place
    change = float(np.clip(place.spread + change, 0.6e-3, 3e-3)) - place.spread
    state.response = state.response * (1 - about * change)
    state.place = replace(place, x=place.x + x, y=place.y + y, z=place.z + z, spread=place.spread + change)


def _softness(field: ArrayField, state: ArrayState) -> Array:
    """By which part each transducer is heard more when the gel spreads a point 1 m further, shape (transducer,).

    Those that come from another side than the beam are heard less: where they meet it, the pattern is finer.
    """
    still = field.codes.level * np.exp(1j * field.codes.still) * state.response

    def heard(place: SensorPlace) -> Complex:
        G, weights = field.matrix(place)
        return (weights * (G @ still).conj()) @ G

    step = 2e-5
    now = heard(state.place)
    change = heard(replace(state.place, spread=state.place.spread + step)) - now
    return (now.conj() * change).real.sum(axis=0) / step / np.square(np.abs(now)).sum(axis=0)


def from_softness(
    field: ArrayField, state: ArrayState, dead: NDArray[np.bool_], usual: TransducerPrior
) -> tuple[Array, float]:
    """What is uncertain of each strength, and of all, since the gel's spread is known by the strengths alone."""
    soft = _softness(field, state)
    alive, size = soft[~dead] - soft[~dead].mean(), np.abs(state.response[~dead])
    known = float(alive @ alive / np.square(size.std() / size.mean()))
    spread = 1 / np.sqrt(known + 1 / usual.softness**2)
    return np.abs(soft - soft[~dead].mean()) * float(size.mean() * spread), float(abs(soft[~dead].mean()) * spread)


def from_place(
    field: ArrayField, state: ArrayState, response: Complex, dead: NDArray[np.bool_], usual: TransducerPrior
) -> Array:
    """What is uncertain of each phase since the sensor's place is known by the transducers' own phases only.

    A sensor that lies elsewhere makes phases late by k times what it is further away. The place was found as if all
    were alike: as sure as a line through phases that scatter as these do.
    """
    pattern = _patterns(field, state.place)
    alive = pattern[~dead]
    scatter = float(np.angle(response[~dead]).std())
    belief = np.diag([1 / usual.length**2] * 3 + [1e-6])
    covariance = np.linalg.inv(alive.T @ alive / scatter**2 + belief)
    pattern = pattern - alive.mean(axis=0)
    return np.sqrt(np.einsum("ni,ij,nj->n", pattern, covariance, pattern))


def real_parts(values: Complex) -> Array:
    """Real parts, then imaginary ones, along the first axis."""
    return np.concatenate([values.real, values.imag])
