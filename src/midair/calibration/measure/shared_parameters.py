"""Estimate the parameters that all transducers share: position of the sensor, softness of its gel, overall strength.

A displaced sensor delays the transducers in a pattern, and a softer gel weakens those at the side. A fit of each
transducer alone cannot separate this from real differences between transducers, which are random. So these parameters
are estimated twice: by Gauss-Newton with identical transducers, and by projecting the fitted phases and strengths on
the patterns. Their remaining uncertainty is part of the uncertainty of each transducer.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.calibration.measure.array_field import ArrayField, SensorPlace
from midair.errors import InputError

DEAD = 0.1
"""Strength relative to the mean below which a transducer is dead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransducerPrior:
    """Prior standard deviations of a transducer."""

    response: float = 0.3
    """Standard deviation of the real and imaginary part, relative to the mean strength."""
    pole: float = 0.2
    """Standard deviation of the real and imaginary part, relative to one over the time constant."""
    length: float = 3e-3
    """Standard deviation of the sensor's position in m."""
    softness: float = 0.5e-3
    """Standard deviation of the width of the gel's point spread, in m."""


@dataclass(slots=True, eq=False)
class ArrayState:
    """Current estimates; response and pole have the shape (transducer,)."""

    response: Complex
    pole: Complex
    place: SensorPlace


def predicted_spectrum(field: ArrayField, group: int, state: ArrayState, q: Complex | None = None) -> Complex:
    """Predicted spectrum of a group's window, shape (bin, cell); `q` is the group's output, if it is known already."""
    G, weights = field.matrix(state.place)
    members = field.codes.groups[group]
    sound = sound_at_points(field, group, state, G, field.followed(group, state.pole[members])[0] if q is None else q)
    return field.predicted(np.abs(sound) ** 2 @ weights.T, group, state.place)


def sound_at_points(field: ArrayField, group: int, state: ArrayState, G: Complex, q: Complex) -> Complex:
    """Sound at the points over time, shape (step, point): the coded group plus all steady transducers."""
    members = field.codes.groups[group]
    still = field.codes.level * np.exp(1j * field.codes.still) * state.response
    still[members] = 0
    return G @ still + q @ (G[:, members] * state.response[members]).T


def fit_shared(
    field: ArrayField, heard: Complex, state: ArrayState, usual: TransducerPrior, *, synchronous: bool
) -> None:
    """Fit the shared parameters to the first group's codes by Gauss-Newton."""
    steps = {"x": 2e-5, "y": 2e-5, "z": 2e-5, "turn": 1e-3, "late": 1e-6, "gain": 1e-3, "spread": 2e-5}
    wide = {"turn": 0.1, "late": 1e-12 if synchronous else 1e-3, "gain": 2.0, "spread": usual.softness}
    belief = np.array([wide.get(name, usual.length) / step for name, step in steps.items()])
    q = field.followed(0, state.pole[field.codes.groups[0]])[0]
    moved = np.zeros(len(steps))
    for _ in range(6):
        now = predicted_spectrum(field, 0, state, q)
        rest = heard - now
        slope = np.empty((2 * rest.size, len(steps)))
        for column, (name, step) in enumerate(steps.items()):
            place = replace(state.place, **{name: getattr(state.place, name) + step})
            changed = predicted_spectrum(field, 0, ArrayState(state.response, state.pole, place), q)
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
    explained = 1 - float(
        np.square(np.abs(heard - predicted_spectrum(field, 0, state))).sum() / np.square(np.abs(heard)).sum()
    )
    if explained < 0.5:
        raise InputError(
            f"array: expected a recording that the model explains, got {100 * max(explained, 0):.0f} % of its power; "
            "put the sensor over the centre of the array, and check its height and calibration"
        )


def _patterns(field: ArrayField, place: SensorPlace) -> Array:
    """Phase delay of each transducer per metre of sensor displacement along x, y, z, in rad; and ones."""
    way = np.array([place.x, place.y, place.z]) - field.array.position
    k = 2 * np.pi * field.array.frequency / field.acoustics.medium.speed
    return np.column_stack([k * way / np.linalg.norm(way, axis=1, keepdims=True), np.ones(len(way))])


def absorb_displacement(field: ArrayField, state: ArrayState, strength: float, usual: TransducerPrior) -> None:
    """Move the part of the phases that a displaced sensor explains into its position, and likewise for the gel.

    To first order, the sound at the sensor stays the same.
    """
    pattern = _patterns(field, state.place)
    alive = np.abs(state.response) > DEAD * strength
    phase = np.angle(state.response * np.exp(-1j * np.angle(state.response[alive].sum())))
    belief = np.diag([float(np.var(phase[alive])) / usual.length**2] * 3 + [0.0])
    moved = np.linalg.solve(pattern[alive].T @ pattern[alive] + belief, pattern[alive].T @ phase[alive])
    x, y, z = (float(each) for each in moved[:3])
    state.response = state.response * np.exp(-1j * (pattern[:, :3] @ moved[:3]))
    soft = softness(field, state)
    size = np.abs(state.response) / np.abs(state.response[alive]).mean() - 1
    about = soft - soft[alive].mean()
    change = float(about[alive] @ size[alive] / (about[alive] @ about[alive] + np.var(size[alive]) / usual.softness**2))
    place = state.place
    change = float(np.clip(place.spread + change, 0.6e-3, 3e-3)) - place.spread
    state.response = state.response * (1 - about * change)
    state.place = replace(place, x=place.x + x, y=place.y + y, z=place.z + z, spread=place.spread + change)


def softness(field: ArrayField, state: ArrayState) -> Array:
    """Relative increase of each transducer's signal per metre of point spread, shape (transducer,).

    Transducers far from the beam's axis lose signal, because they interfere with the beam in finer patterns.
    """
    still = field.codes.level * np.exp(1j * field.codes.still) * state.response

    def heard(place: SensorPlace) -> Complex:
        G, weights = field.matrix(place)
        return (weights * (G @ still).conj()) @ G

    step = 2e-5
    now = heard(state.place)
    change = heard(replace(state.place, spread=state.place.spread + step)) - now
    return (now.conj() * change).real.sum(axis=0) / step / np.square(np.abs(now)).sum(axis=0)


def gel_strength_error(
    field: ArrayField, state: ArrayState, dead: NDArray[np.bool_], usual: TransducerPrior
) -> tuple[Array, float]:
    """Uncertainty of each strength, and of their mean, from the estimate of the gel's point spread."""
    soft = softness(field, state)
    alive, size = soft[~dead] - soft[~dead].mean(), np.abs(state.response[~dead])
    known = float(alive @ alive / np.square(size.std() / size.mean()))
    spread = 1 / np.sqrt(known + 1 / usual.softness**2)
    return np.abs(soft - soft[~dead].mean()) * float(size.mean() * spread), float(abs(soft[~dead].mean()) * spread)


def position_phase_error(
    field: ArrayField, state: ArrayState, response: Complex, dead: NDArray[np.bool_], usual: TransducerPrior
) -> Array:
    """Uncertainty of each phase from the estimate of the sensor's position, which uses these phases only.

    A displaced sensor delays phases by k times the change of distance. The position was fitted with identical
    transducers, so its covariance is that of a linear fit to phases with this scatter.
    """
    pattern = _patterns(field, state.place)
    alive = pattern[~dead]
    scatter = float(np.angle(response[~dead]).std())
    belief = np.diag([1 / usual.length**2] * 3 + [1e-6])
    covariance = np.linalg.inv(alive.T @ alive / scatter**2 + belief)
    pattern = pattern - alive.mean(axis=0)
    return np.sqrt(np.einsum("ni,ij,nj->n", pattern, covariance, pattern))


def group_displacement(field: ArrayField, state: ArrayState, dead: NDArray[np.bool_]) -> tuple[float, float]:
    """Largest displacement in m between the sensor's position during one group's codes and the mean of all.

    The second number is its standard uncertainty, from the scatter of the phases.
    """
    pattern, phase = _patterns(field, state.place), np.angle(state.response)
    found, errors = [], []
    for members in field.codes.groups:
        some = members[~dead[members]]
        rest = np.angle(np.exp(1j * (phase[some] - np.angle(state.response[some].sum()))))
        inverse = np.linalg.inv(pattern[some].T @ pattern[some] + np.diag([1e-3, 1e-3, 1e-3, 0]))
        found.append((inverse @ pattern[some].T @ rest)[:3])
        left = rest - pattern[some, :3] @ found[-1]
        errors.append(np.sqrt(np.diag(inverse)[:3]) * left.std())
    away = np.array(found) - np.mean(found, axis=0)
    group, axis = np.unravel_index(np.argmax(np.abs(away)), away.shape)
    return float(abs(away[group, axis])), float(errors[group][axis])


def real_parts(values: Complex) -> Array:
    """Real parts, then imaginary parts, along the first axis."""
    return np.concatenate([values.real, values.imag])
