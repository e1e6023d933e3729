"""Fit the response of every transducer of an array to a sensor's recording of phase codes.

First the shared parameters (position of the sensor, overall strength) are fitted by Gauss-Newton with identical
transducers. Then the responses and poles of each group are fitted with the other groups fixed, and this is repeated
until convergence, because the squared sound couples the groups weakly. The noise is white, so the normal matrix over
its variance is the information. A prior (transducers within 30 %, time constants within 20 % of the model) is added,
and the inverse of the sum is the covariance (A. Gelman et al., Bayesian Data Analysis, 3rd ed., 14.8).
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from midair.calibration.measure.array_field import ArrayField, SensorPlace, pole_of
from midair.calibration.measure.shared_parameters import (
    DEAD,
    ArrayState,
    TransducerPrior,
    absorb_displacement,
    fit_shared,
    gel_strength_error,
    position_phase_error,
    predicted_spectrum,
    real_parts,
    sound_at_points,
)
from midair.model import ArrayCalibration, Progress, Provenance
from midair.physics import TransducerDynamics

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Slope:
    """Jacobian (number, unknown) and posterior covariance of a group's responses and scaled poles."""

    jacobian: Array
    covariance: Array


def fit_array(
    field: ArrayField,
    samples: Array,
    *,
    dynamics: TransducerDynamics | None = None,
    usual: TransducerPrior | None = None,
    sweeps: int = 4,
    synchronous: bool = True,
    level_uncertainty: float = 0.0,
    date: str = "",
    provenance: Provenance | None = None,
    progress: Progress | None = None,
) -> ArrayCalibration:
    """Estimate the transducers of an array from a sensor's recording of their codes.

    Parameters
    ----------
    field : ArrayField
        Model of the codes and of the sensor.
    samples : ndarray, shape (frame, channel)
        Output of the sensor from the first frame of the codes on.
    dynamics : TransducerDynamics, optional
        Dynamics of the model's transducers.
    usual : TransducerPrior, optional
        Prior of the transducers.
    sweeps : int
        Number of fits of each group.
    synchronous : bool
        Whether the first sample belongs to the first frame. If not, the delay is fitted too, and the mean time constant
        stays unknown: slow transducers and a late array have the same effect.
    level_uncertainty : float
        Relative standard uncertainty of the sensor's pressure that all cells share.
    date, provenance
        As in `ArrayCalibration`.
    progress : callable, optional
        Called with (groups fitted, groups in all).

    Raises
    ------
    InputError
        If the recording does not match the model.
    ShapeError
        If there are fewer samples than codes.
    """
    usual, nominal = usual or TransducerPrior(), pole_of(dynamics or TransducerDynamics())
    measured = [field.spectrum(samples, group) for group in range(len(field.codes.groups))]
    noise = _noise(field)
    count = field.array.count
    state = ArrayState(np.ones(count, complex), np.full(count, nominal), SensorPlace(z=field.height))
    fit_shared(field, measured[0], state, usual, synchronous=synchronous)
    strength = np.sqrt(state.place.gain)
    state.response *= strength
    state.place = replace(state.place, gain=1.0)
    slopes: list[_Slope] = []
    common = np.zeros((2, len(measured)))
    total = sweeps * len(measured)
    for sweep in range(sweeps):
        if sweep < 2:
            slopes = []
        for group, heard in enumerate(measured):
            if len(slopes) <= group:
                slopes.append(_slope(field, group, state, noise, usual, strength, nominal))
            _step(field, group, heard, state, slopes[group], noise, usual, strength, nominal)
            if progress:
                progress(sweep * len(measured) + group + 1, total)
        common = _balance(field, measured, state, noise, usual)
        if sweep < 2:
            absorb_displacement(field, state, strength, usual)
    shared = 0.0 if synchronous else usual.pole
    return _result(
        field,
        measured,
        state,
        slopes,
        common,
        noise,
        usual,
        nominal,
        strength,
        level_uncertainty,
        shared,
        date,
        provenance,
    )


def _noise(field: ArrayField) -> Array:
    """Variance of the real or the imaginary part of a bin for each group, shape (group,)."""
    density = float(np.sqrt((field.calibration.noise.ravel()[list(field.codes.cells)] ** 2).mean()))
    frames = np.array([end - begin for begin, end in map(field.window, range(len(field.codes.groups)))])
    frames = frames * field.rate / field.codes.rate
    # Variance of a bin of the normalised FFT: variance of a sample (n^2 times half the rate) over the number of
    # frames, one half each in the real and the imaginary part.
    return np.maximum(density, 1e-12) ** 2 * field.rate / 2 / frames / 2


def _slope(
    field: ArrayField,
    group: int,
    state: ArrayState,
    noise: Array,
    usual: TransducerPrior,
    strength: float,
    nominal: complex,
) -> _Slope:
    members = field.codes.groups[group]
    G, weights = field.matrix(state.place)
    q, change = field.followed(group, state.pole[members])
    sound = sound_at_points(field, group, state, G, q)
    moving = change * state.response[members] * abs(nominal.real)
    rows: list[Array] = []
    for cell, weight in enumerate(weights):
        near = np.abs(weight) > 1e-4 * weight.max()
        across = 2 * (sound[:, near].conj() * weight[near]) @ G[np.ix_(near, members)]
        parts = [across * q, across * moving]
        columns = np.concatenate([part for each in parts for part in (each.real, -each.imag)], axis=1)
        bins, answer = field.answer(group, state.place)
        spectrum = np.fft.rfft(columns, axis=0)[bins] / len(columns) * answer[:, cell, None]
        rows.append(real_parts(spectrum))
    jacobian = np.concatenate(rows)
    information = jacobian.T @ jacobian / noise[group]
    information[np.diag_indices_from(information)] += 1 / _belief(len(members), usual, strength) ** 2
    return _Slope(jacobian=jacobian, covariance=np.linalg.inv(information))


def _belief(members: int, usual: TransducerPrior, strength: float) -> Array:
    return np.repeat([usual.response * strength, usual.pole], 2 * members)


def _step(
    field: ArrayField,
    group: int,
    heard: Complex,
    state: ArrayState,
    slope: _Slope,
    noise: Array,
    usual: TransducerPrior,
    strength: float,
    nominal: complex,
) -> None:
    """One Gauss-Newton step for the unknowns of a group, with the other groups fixed."""
    members = field.codes.groups[group]
    rest = heard - predicted_spectrum(field, group, state)
    now = _unknowns(state.response[members] - strength, (state.pole[members] - nominal) / abs(nominal.real))
    pull = now / _belief(len(members), usual, strength) ** 2
    gradient = slope.jacobian.T @ np.concatenate([real_parts(cell) for cell in rest.T])
    change = slope.covariance @ (gradient / noise[group] - pull)
    real, imag, slow, turning = change.reshape(4, -1)
    state.response[members] += real + 1j * imag
    pole = state.pole[members] + abs(nominal.real) * (slow + 1j * turning)
    # Keep the pole stable: a step that is too large would make the response grow.
    state.pole[members] = np.minimum(pole.real, 0.2 * nominal.real) + 1j * pole.imag


def _balance(
    field: ArrayField, measured: list[Complex], state: ArrayState, noise: Array, usual: TransducerPrior
) -> Array:
    """Fit one complex factor per group to all windows together; return its uncertainty, shape (2, group).

    Fitting the groups in turn converges slowly, because each fit takes the other groups as exact.
    """
    groups = field.codes.groups
    if len(groups) == 1:
        return np.zeros((2, 1))
    G, weights = field.matrix(state.place)
    still = field.codes.level * np.exp(1j * field.codes.still) * state.response
    steady = np.stack([G[:, members] @ still[members] for members in groups])
    belief = np.sqrt([len(members) for members in groups]) / usual.response
    information, gradient = np.diag(np.tile(belief, 2) ** 2), np.zeros(2 * len(groups))
    for group, (members, heard) in enumerate(zip(groups, measured, strict=True)):
        q = field.followed(group, state.pole[members])[0]
        moving = q @ (G[:, members] * state.response[members]).T
        sound = steady.sum(axis=0) - steady[group] + moving
        columns = np.empty((len(sound), len(weights), 2 * len(groups)))
        for other in range(len(groups)):
            product = 2 * (sound.conj() * (moving if other == group else steady[other])) @ weights.T
            columns[..., other], columns[..., len(groups) + other] = product.real, -product.imag
        slope = real_parts(field.predicted(columns, group, state.place)).reshape(-1, 2 * len(groups))
        rest = heard - field.predicted(np.abs(sound) ** 2 @ weights.T, group, state.place)
        information += slope.T @ slope / noise[group]
        gradient += slope.T @ real_parts(rest).ravel() / noise[group]
    covariance = np.linalg.inv(information)
    change = covariance @ gradient
    for members, along, across in zip(groups, change[: len(groups)], change[len(groups) :], strict=True):
        state.response[members] *= 1 + along + 1j * across
    # A phase that all groups share has no effect on the output and is no error.
    keep = np.eye(len(groups)) - 1 / len(groups)
    part = covariance[len(groups) :, len(groups) :]
    across = np.sqrt(np.diag(keep @ part @ keep.T))
    return np.stack([np.sqrt(np.diag(covariance)[: len(groups)]), across])


def _unknowns(response: Complex, pole: Complex) -> Array:
    return np.concatenate([response.real, response.imag, pole.real, pole.imag])


def _result(
    field: ArrayField,
    measured: list[Complex],
    state: ArrayState,
    slopes: list[_Slope],
    common: Array,
    noise: Array,
    usual: TransducerPrior,
    nominal: complex,
    strength: float,
    level_uncertainty: float,
    shared: float,
    date: str,
    provenance: Provenance | None,
) -> ArrayCalibration:
    count = field.array.count
    errors = np.empty((4, count))
    for group, slope in enumerate(slopes):
        members = field.codes.groups[group]
        rest = real_parts((measured[group] - predicted_spectrum(field, group, state)).ravel())
        freedom = rest.size - np.einsum("ij,ji->", slope.covariance, slope.jacobian.T @ slope.jacobian) / noise[group]
        # Residuals above the sensor's noise increase every uncertainty (R. Birge, Phys. Rev. 40, 1932).
        excess = max(1.0, float(np.square(rest).sum() / noise[group] / freedom))
        errors[:, members] = np.sqrt(excess) * _errors(
            slope.covariance, state.response[members], alone=len(measured) == 1
        )
        errors[:2, members] = np.hypot(errors[:2, members], np.sqrt(excess) * common[:, [group]] * strength)
    dead = np.abs(state.response) < DEAD * strength
    size = np.where(dead, strength, np.abs(state.response))
    response = state.response * np.exp(-1j * np.angle(state.response[~dead].sum()))
    pole: Complex = np.where(dead, nominal, state.pole)
    errors[2:] = np.where(dead, usual.pole, errors[2:])
    soft, level = gel_strength_error(field, state, dead, usual)
    across = np.hypot(np.hypot(*errors[:2]) / np.sqrt(2), soft)
    phase = np.where(
        dead,
        np.pi / np.sqrt(3),
        np.hypot(across / size, position_phase_error(field, state, response, dead, usual)),
    )
    scale = abs(nominal.real)
    return ArrayCalibration(
        array=field.array,
        response=np.where(dead, 0, response),
        pole=pole,
        strength_uncertainty=np.hypot(errors[0], soft),
        phase_uncertainty=phase,
        resonance_uncertainty=errors[3] * scale / (2 * np.pi),
        quality_uncertainty=np.hypot(errors[2], shared) * scale / np.abs(np.real(pole)),
        dead=dead,
        level_uncertainty=float(np.hypot(level_uncertainty / 2, level)),
        date=date,
        provenance=(provenance or Provenance()).then("fit array", _provenance_settings(state.place, field)),
    )


def _errors(covariance: Array, response: Complex, *, alone: bool) -> Array:
    """Standard uncertainties, shape (4, transducer): along each response, across it, and of the two parts of its pole.

    With a single group, a phase that all transducers share has no effect on the output and is no error.
    """
    count = len(response)
    if alone:
        turned = np.concatenate([-response.imag, response.real, np.zeros(2 * count)])
        keep = np.eye(4 * count) - np.outer(turned, turned) / (turned @ turned)
        covariance = keep @ covariance @ keep.T
    variance = np.diag(covariance).reshape(4, -1)
    both = covariance[np.arange(count), count + np.arange(count)]
    cos, sin = np.cos(np.angle(response)), np.sin(np.angle(response))
    mixed = 2 * cos * sin * both
    along = cos**2 * variance[0] + sin**2 * variance[1] + mixed
    across = sin**2 * variance[0] + cos**2 * variance[1] - mixed
    return np.sqrt(np.stack([along, across, variance[2], variance[3]]))


def _provenance_settings(place: SensorPlace, field: ArrayField) -> dict[str, float | int]:
    where = {f"sensor_{each.name}": float(getattr(place, each.name)) for each in fields(place) if each.name != "gain"}
    return {**where, "groups": len(field.codes.groups), "frames": field.codes.frames, "rate_hz": field.codes.rate}
