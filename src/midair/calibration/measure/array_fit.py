"""Fit the response of every transducer of an array to a sensor's recording of phase codes.

First the shared parameters (position of the sensor, overall strength) are fitted by Gauss-Newton with identical
transducers. Then the responses and poles of each group are fitted with the other groups fixed, and this is repeated
until convergence, because the squared sound couples the groups weakly. The noise is white, so the normal matrix over
its variance is the information. A prior (transducers within 30 %, time constants within 20 % of the model) is added,
and the inverse of the sum is the covariance (A. Gelman et al., Bayesian Data Analysis, 3rd ed., 14.8). Positions,
angles and time offsets of the units are fitted in between (`unit_poses`).
"""

from dataclasses import fields, replace

import numpy as np

from midair.array_types import Array, Complex
from midair.calibration.measure.array_field import ArrayField, SensorPlace
from midair.calibration.measure.group_fit import GroupFit
from midair.calibration.measure.shared_parameters import (
    DEAD,
    ArrayState,
    TransducerPrior,
    absorb_displacement,
    fit_shared,
    gel_strength_error,
    group_displacement,
    position_phase_error,
)
from midair.calibration.measure.unit_poses import cell_places, differences, fit_units
from midair.model import ArrayCalibration, Progress, Provenance
from midair.physics import TransducerDynamics, transfer_matrix

_UNIT_ERROR = 0.09e-3
"""Standard uncertainty in m of x and y of a unit, since directivity and gel differ from the model: fitted to arrays
of another model (benchmarks/unknown_arrays.py).
"""

_CLOSE = 1.5
"""Power of the remainder over that of the noise below which a fit may end, once the units stay where they are."""


def fit_array(
    field: ArrayField,
    samples: Array,
    *,
    dynamics: TransducerDynamics | None = None,
    usual: TransducerPrior | None = None,
    sweeps: int = 12,
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
        Largest number of fits of each group; at least 4, if that many are allowed. It ends when the units stay where
        they are, and the remainder is close to the noise or no longer falls.
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
    usual, nominal = usual or TransducerPrior(), (dynamics or TransducerDynamics()).pole
    count, groups = field.array.count, range(len(field.codes.groups))
    state = ArrayState(np.ones(count, complex), np.full(count, nominal), SensorPlace(z=field.height))
    measured = [field.spectrum(samples, group) for group in groups]
    fit_shared(field, measured[0], state, usual, synchronous=synchronous)
    strength = float(np.sqrt(state.place.gain))
    state.response *= strength
    state.place = replace(state.place, gain=1.0)
    fit = GroupFit(
        field=field,
        measured=measured,
        state=state,
        usual=usual,
        strength=strength,
        centre=np.full(count, strength, complex),
        pole=np.full(count, nominal),
        slopes=[],
    )
    common = np.zeros((2, len(groups)))
    units = len(np.unique(field.array.unit))
    pose, covariance = np.zeros((units, 7)), np.zeros((7 * units, 7 * units))
    left, settled = [np.inf], units == 1
    for sweep in range(sweeps):
        if sweep > 3 and settled and (left[-1] < _CLOSE or left[-1] > 0.97 * min(left[:-2])):
            break
        if units > 1 and sweep > 1:
            last = pose
            pose, covariance = fit_units(fit, field.array, pose, synchronous=synchronous)
            moved, uncertain = differences(field.array, pose - last, covariance)
            settled = bool((np.abs(moved.ravel()) < 0.5 * np.sqrt(np.diag(uncertain))).all())
        for group in groups:
            # Slopes of an earlier state would end the fit beside the minimum.
            fit.slopes[group : group + 1] = [fit.slope(group)]
            fit.step(group)
            if progress:
                progress(sweep * len(groups) + group + 1, sweeps * len(groups))
        common = fit.balance()
        left.append(float(np.mean([np.square(fit.residual(group)).mean() / fit.noise[group] for group in groups])))
        if sweep < 2:
            before = state.response.copy()
            absorb_displacement(fit.field, state, strength, usual)
            fit.turn(before)
    return _result(
        fit, field, common, 0.0 if synchronous else usual.pole, level_uncertainty, (pose, covariance), date, provenance
    )


def _result(
    fit: GroupFit,
    field: ArrayField,
    common: Array,
    shared: float,
    level_uncertainty: float,
    units: tuple[Array, Array],
    date: str,
    provenance: Provenance | None,
) -> ArrayCalibration:
    state, strength, usual, count = fit.state, fit.strength, fit.usual, field.array.count
    errors, worst = np.empty((4, count)), 1.0
    for group, slope in enumerate(fit.slopes):
        members, noise = fit.groups[group], fit.noise[group]
        rest = fit.residual(group)
        freedom = rest.size - np.einsum("ij,ji->", slope.covariance, slope.jacobian.T @ slope.jacobian) / noise
        # Residuals above the sensor's noise increase every uncertainty (R. Birge, Phys. Rev. 40, 1932).
        excess = max(1.0, float(np.square(rest).sum() / noise / freedom))
        worst = max(worst, excess)
        errors[:, members] = np.sqrt(excess) * _errors(
            slope.covariance, state.response[members], alone=len(fit.groups) == 1
        )
        errors[:2, members] = np.hypot(errors[:2, members], np.sqrt(excess) * common[:, [group]] * strength)
    dead = np.abs(state.response) < DEAD * strength
    size = np.where(dead, strength, np.abs(state.response))
    soft, level = gel_strength_error(fit.field, state, dead, usual)
    across = np.hypot(np.hypot(*errors[:2]) / np.sqrt(2), soft)
    alike = state.response * np.exp(-1j * np.angle(state.response[~dead].sum()))
    phase = np.hypot(across / size, position_phase_error(fit.field, state, alike, dead, usual))
    moved, uncertain = group_displacement(fit.field, state, dead)
    # Relative to the nominal positions, at the cells under the beam.
    nominal, true = (transfer_matrix(cell_places(field, state.place), each.array) for each in (field, fit.field))
    response = state.response * (true * nominal.conj()).sum(axis=0) / np.square(np.abs(nominal)).sum(axis=0)
    response *= np.exp(-1j * np.angle(response[~dead].sum()))
    pole: Complex = np.where(dead, fit.pole, state.pole)
    errors[2:] = np.where(dead, usual.pole, errors[2:])
    scale = np.abs(fit.pole.real)
    told = {
        **{f"sensor_{each.name}": float(getattr(state.place, each.name)) for each in fields(state.place)},
        **{"groups": len(fit.groups), "frames": field.codes.frames, "rate_hz": field.codes.rate},
        **{"noise_ratio": float(np.sqrt(worst)), "moved_m": moved, "moved_uncertainty_m": uncertain},
    }
    pose, covariance = units
    if len(pose) > 1:
        unlike = np.diag(np.tile([_UNIT_ERROR**2] * 2 + [0.0] * 5, len(pose)))
        pose, covariance = differences(field.array, pose, covariance + unlike)
    return ArrayCalibration(
        array=field.array,
        response=np.where(dead, 0, response),
        pole=pole,
        strength_uncertainty=np.hypot(errors[0], soft),
        phase_uncertainty=np.where(dead, np.pi / np.sqrt(3), phase),
        resonance_uncertainty=errors[3] * scale / (2 * np.pi),
        quality_uncertainty=np.hypot(errors[2], shared) * scale / np.abs(np.real(pole)),
        dead=dead,
        pose=pose,
        pose_covariance=covariance,
        level_uncertainty=float(np.hypot(level_uncertainty / 2, level)),
        date=date,
        provenance=(provenance or Provenance()).then("fit array", told),
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
