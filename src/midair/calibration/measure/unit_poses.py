"""Fit position, rotation and time offset of each unit of an array to the codes.

A unit that is out of place changes the phases of its transducers: by -k e.d for a displacement d, with e the direction
from the transducer to the cell; by -k e.(w x r) for a rotation w about the middle of the unit, r being the position
relative to it; and by 2 pi f t for a delay t. Two things separate this from differences between transducers. The cells
see it from different directions: that part is fitted to the recording, with the responses eliminated from the normal
equations (Schur complement). And the mean over the cells is a smooth pattern, while transducers differ at random, by
the scatter that is observed.

The array as a whole and the sensor cannot be told apart, nor a common delay: only differences between units count.

A tracker is placed by the rotation and the offset between places that it and the array measured (Kabsch 1976).
"""

from dataclasses import replace

import numpy as np
import scipy

from midair.array_types import Array
from midair.calibration.measure.array_field import ArrayField, SensorPlace, cell_places
from midair.calibration.measure.group_fit import (
    DEAD,
    ArrayState,
    GroupFit,
    predicted_spectrum,
    real_parts,
    softness,
    sound_at_points,
)
from midair.errors import InputError
from midair.model import POSE_AIMS, TrackerPlacement, TransducerArray
from midair.physics import transfer_matrix, wavenumber

_PRIOR = 20.0
"""Prior standard deviation of every number of a pose, in units of `POSE_AIMS`: 2 mm, 2 degrees, 1 us."""


_SHARED = np.array([0.1e-3, 1e-6])
"""Units of the width of the gel's point spread in m and of the array's delay in s."""


def fit_units(fit: GroupFit, nominal: TransducerArray, pose: Array, *, synchronous: bool = True) -> tuple[Array, Array]:
    """One Gauss-Newton step of the units from their current `pose` on; the sound at the sensor stays the same.

    The gel's point spread and the array's delay are fitted with them: both were estimated with identical transducers,
    and an error of them would appear in the units.

    Returns the new pose, shape (unit, 7): x, y, z in m, the rotation about x, y, z in rad, and the delay in s; and its
    covariance, shape (7 unit, 7 unit).
    """
    model, state = fit.field, fit.state
    unit = np.unique(nominal.unit, return_inverse=True)[1]
    aims = np.tile(POSE_AIMS, len(pose))
    mean = phase_pattern(model.array, cell_places(model, state.place), model).mean(axis=0) * aims
    alive = np.abs(state.response) > DEAD * fit.strength
    late = np.exp(2j * np.pi * nominal.frequency * pose[unit, 6])
    own = state.response * late.conj()
    phase = np.angle(own * np.exp(-1j * np.angle(own[alive].sum())))[alive]
    even, phase = mean[alive] - mean[alive].mean(axis=0), phase - phase.mean()
    scatter = max(float((phase - even @ np.linalg.lstsq(even, phase, rcond=1e-6)[0]).std()), 0.01)
    count, place, soft = len(aims), state.place, softness(model, state)
    information, gradient = np.zeros((count + 2, count + 2)), np.zeros(count + 2)
    information[:count, :count] = even.T @ even / scatter**2 + np.eye(count) / _PRIOR**2
    gradient[:count] = even.T @ phase / scatter**2 - (pose / POSE_AIMS).ravel() / _PRIOR**2
    size, about = np.abs(state.response)[alive], (soft[alive] - soft[alive].mean()) * _SHARED[0]
    size = size / size.mean() - 1
    wide = np.array([fit.usual.softness, 1e-12 if synchronous else 1e-3]) / _SHARED
    information[count:, count:] = np.diag([about @ about / np.var(size), 0] + 1 / wide**2)
    gradient[count:] = [
        about @ size / np.var(size) - (place.spread - SensorPlace().spread) / _SHARED[0] / wide[0] ** 2,
        0,
    ]
    for group in range(len(fit.slopes)):
        moved = np.column_stack([columns_of_units(fit, group, aims, mean), _shared_columns(fit, group, soft)])
        # Without the pull of the prior on the responses: what the phases have in common counts above, by its scatter.
        told, towards = fit.shared(group, moved)
        information, gradient = information + told, gradient + towards
    covariance = np.linalg.inv(information)
    change = covariance @ gradient
    pose = pose + (change[:count] * aims).reshape(-1, 7)
    softer, later = change[count:] * _SHARED
    softer = float(np.clip(place.spread + softer, 0.6e-3, 3e-3)) - place.spread
    state.response *= 1 - (soft - soft[alive].mean()) * softer
    state.place = replace(place, spread=place.spread + softer, late=place.late + float(later))
    before, old = state.response.copy(), transfer_matrix(cell_places(model, state.place), model.array)
    fit.field = replace(model, array=moved_array(nominal, pose))
    new = transfer_matrix(cell_places(model, state.place), fit.field.array)
    state.response *= (new.conj() * old).sum(axis=0) / np.square(np.abs(new)).sum(axis=0)
    fit.turn(before)
    return pose, np.asarray(covariance[:count, :count] * np.outer(aims, aims), np.float64)


def _shared_columns(fit: GroupFit, group: int, soft: Array) -> Array:
    """Change of a group's spectrum for the gel's point spread, with constant signals, and for the array's delay."""
    state, now, columns = fit.state, predicted_spectrum(fit.field, group, fit.state), []
    for name, step in (("spread", 0.1 * _SHARED[0]), ("late", _SHARED[1])):
        place = replace(state.place, **{name: getattr(state.place, name) + step})
        response = state.response * (1 - soft * step) if name == "spread" else state.response
        changed = predicted_spectrum(fit.field, group, ArrayState(response, state.pole, place)) - now
        scale = _SHARED[0] / step if name == "spread" else 1.0
        columns.append(scale * np.concatenate([real_parts(cell) for cell in changed.T]))
    return np.column_stack(columns)


def columns_of_units(fit: GroupFit, group: int, aims: Array, absorbed: Array) -> Array:
    """Change of a group's spectrum for each number of each unit in `aims`, rows as in `GroupFit.residual`.

    The responses absorb the phases `absorbed`, shape (transducer, 7 unit). The sound of a coded transducer counts by
    the mean beam over each cell.
    """
    model, state, members = fit.field, fit.state, fit.groups[group]
    G, weights = model.matrix(state.place)
    sound = sound_at_points(model, group, state, G, model.followed(group, state.pole[members])[0])
    still = model.codes.level * np.exp(1j * model.codes.still) * state.response
    still[members] = 0
    beam, points = sound.mean(axis=0).conj(), model.points(state.place)
    count, steps = len(members), np.split(fit.slopes[group].jacobian, len(weights))
    response, rows = state.response[members], []
    for cell, (weight, step) in enumerate(zip(weights, steps, strict=True)):
        near = np.abs(weight) > 1e-4 * weight.max()
        pattern = phase_pattern(model.array, points[near], model) * aims - absorbed
        shares = (weight[near] * beam[near])[:, None] * G[near]
        mean = np.einsum("pn,pnu->nu", shares[:, members], pattern[:, members])
        turned = 1j * mean * (response / shares[:, members].sum(axis=0))[:, None]
        steady = 1j * np.einsum("pn,pnu->pu", G[near] * still, pattern)
        columns = 2 * ((sound[:, near].conj() * weight[near]) @ steady).real
        bins, answer = model.answer(group, state.place)
        spectrum = np.fft.rfft(columns, axis=0)[bins] / len(columns) * answer[:, cell, None]
        coded = step[:, :count] @ turned.real + step[:, count : 2 * count] @ turned.imag
        rows.append(coded + real_parts(spectrum))
    return np.concatenate(rows)


def phase_pattern(array: TransducerArray, points: Array, model: ArrayField) -> Array:
    """Phase of each transducer at each point for each number of each unit, shape (point, transducer, 7 unit)."""
    k = wavenumber(array, model.acoustics.medium)
    way = points[:, None] - array.position
    way /= np.linalg.norm(way, axis=2, keepdims=True)
    names = np.unique(array.unit)
    pattern = np.zeros((len(points), array.count, len(names), 7))
    for number, name in enumerate(names):
        own = array.unit == name
        away = array.position[own] - array.position[own].mean(axis=0)
        pattern[:, own, number, :3] = -k * way[:, own]
        # e.(w x r) = w.(r x e)
        pattern[:, own, number, 3:6] = -k * np.cross(away, way[:, own])
        pattern[:, own, number, 6] = 2 * np.pi * array.frequency
    return pattern.reshape(*pattern.shape[:2], -1)


def moved_array(array: TransducerArray, pose: Array) -> TransducerArray:
    """The array with its units displaced and rotated by `pose`, shape (unit, 7)."""
    position, normal = array.position.copy(), array.normal.copy()
    for name, each in zip(np.unique(array.unit), pose, strict=True):
        own, turn = array.unit == name, scipy.spatial.transform.Rotation.from_rotvec(each[3:6])
        middle = position[own].mean(axis=0)
        position[own] = turn.apply(position[own] - middle) + middle + each[:3]
        normal[own] = turn.apply(normal[own])
    return replace(array, position=position, normal=normal)


def differences(array: TransducerArray, pose: Array, covariance: Array) -> tuple[Array, Array]:
    """Pose and covariance without what the units share: the motion of the array as a rigid body, and a delay."""
    names, middle = np.unique(array.unit), array.position.mean(axis=0)
    rigid = np.zeros((len(names), 7, 7))
    for number, name in enumerate(names):
        x, y, z = array.position[array.unit == name].mean(axis=0) - middle
        rigid[number] = np.eye(7)
        # w x r for rotations of the whole array.
        rigid[number, :3, 3:6] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    weight = 1 / np.tile(POSE_AIMS, len(names)) ** 2
    shared = rigid.reshape(-1, 7)
    keep = np.eye(len(weight)) - shared @ np.linalg.solve(shared.T * weight @ shared, shared.T * weight)
    return (keep @ pose.ravel()).reshape(pose.shape), keep @ covariance @ keep.T


LEAST_SPREAD = 0.02
"""Least standard deviation of the places at right angles to their longest extent, in m: below it they are collinear."""
LARGEST_SCATTER = 0.02
"""Largest scatter of a coordinate in m; above it the tracker followed something else."""


def fit_tracker(held: Array, places: Array) -> TrackerPlacement:
    """Placement of a tracker from 3 or more places, by least squares.

    The uncertainty follows from the scatter s of the coordinates, whose 3 n values have 3 n - 6 degrees of freedom:
    s sqrt(2 / n) for each coordinate of a placed point, on average over the places, times the ratio of Student's t to
    the normal distribution, so that twice the uncertainty covers 95 %.

    `held`, shape (place, 3), are the places by the tracker, and `places` the same ones in array coordinates, in m.
    Raises InputError if there are less than three, they are collinear, or they do not fit a rotation.
    """
    count = len(places)
    if count < 3 or held.shape != places.shape:
        raise InputError(f"tracker: expected 3 places or more, held as often as marked, got {len(held)} of {count}")
    for name, points in (("marked", places), ("held", held)):
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] / np.sqrt(count)
        if spread < LEAST_SPREAD:
            raise InputError(
                f"tracker: expected {name} places that are not in one line, got {1e3 * spread:.0f} mm beside it; "
                f"choose places {1e3 * LEAST_SPREAD:.0f} mm or more off the line"
            )
    left, _, right = np.linalg.svd((places - places.mean(axis=0)).T @ (held - held.mean(axis=0)))
    rotation = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    offset = places.mean(axis=0) - rotation @ held.mean(axis=0)
    freedom = 3 * count - 6
    scatter = float(np.sqrt((((held @ rotation.T + offset) - places) ** 2).sum() / freedom))
    if scatter > LARGEST_SCATTER:
        raise InputError(
            f"tracker: expected the held places to fit the marked ones, they scatter by {1e3 * scatter:.0f} mm; hold "
            "the palm where the focus is felt, and check the order of the places"
        )
    wider = scipy.special.stdtrit(freedom, 0.975) / 1.96
    return TrackerPlacement(rotation=rotation, offset=offset, uncertainty=scatter * np.sqrt(2 / count) * wider)
