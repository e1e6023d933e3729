"""Fit the response of every transducer of an array to a sensor's recording of phase codes, and check it later.

First the shared parameters (position of the sensor, overall strength) are fitted by Gauss-Newton with identical
transducers. Then the responses and poles of each group are fitted with the other groups fixed, and this is repeated
until convergence, because the squared sound couples the groups weakly. The noise is white, so the normal matrix over
its variance is the information. A prior (transducers within 30 %, time constants within 20 % of the model) is added,
and the inverse of the sum is the covariance (A. Gelman et al., Bayesian Data Analysis, 3rd ed., 14.8). Positions,
angles and time offsets of the units are fitted in between (`unit_poses`).
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.calibration.measure.array_field import ArrayField, SensorPlace, cell_places
from midair.calibration.measure.group_fit import (
    DEAD,
    ArrayState,
    GroupFit,
    TransducerPrior,
    absorb_displacement,
    fit_shared,
    gel_strength_error,
    group_displacement,
    position_phase_error,
)
from midair.calibration.measure.unit_poses import differences, fit_units
from midair.errors import MismatchError
from midair.model import ArrayCalibration, Progress, Provenance
from midair.physics import TransducerDynamics, transfer_matrix, wavenumber

_UNIT_ERROR = 0.11e-3
"""Standard uncertainty in m of x and y of a unit, since directivity and gel differ from the model: fitted to arrays
of another model (benchmarks/unknown_arrays.py).
"""

_SWEEPS = 12
"""Largest number of fits of each group; at least 4. It ends when the units stay where they are, and the remainder is
close to the noise or no longer falls.
"""

_CLOSE = 1.5
"""Power of the remainder over that of the noise below which a fit may end, once the units stay where they are."""


def fit_array(
    field: ArrayField,
    samples: Array,
    *,
    synchronous: bool = True,
    level_uncertainty: float = 0.0,
    date: str = "",
    provenance: Provenance | None = None,
    progress: Progress | None = None,
) -> ArrayCalibration:
    """Estimate the transducers of an array from a sensor's recording of their codes.

    `samples`, shape (frame, channel), are the sensor's output from the first frame of the codes on. `synchronous` means
    that their first belongs to the first frame. If not, the delay is fitted too, and the mean time constant stays
    unknown: slow transducers and a late array have the same effect. `level_uncertainty` is the relative standard
    uncertainty of the sensor's pressure that all cells share; `date` and `provenance` are those of `ArrayCalibration`;
    `progress` is called with (groups fitted, groups in all). Raises InputError if the recording does not match the
    model, ShapeError if there are fewer samples than codes.
    """
    usual, nominal = TransducerPrior(), TransducerDynamics().pole
    count, groups = field.array.count, range(len(field.codes.groups))
    state = ArrayState(np.ones(count, complex), np.full(count, nominal), SensorPlace(z=field.height))
    measured = [field.spectrum(samples, group) for group in groups]
    fit_shared(field, measured[0], state, usual, synchronous=synchronous)
    strength = float(np.sqrt(state.place.gain))
    state.response *= strength
    state.place = replace(state.place, gain=1.0)
    told: Any = {"field": field, "measured": measured, "state": state, "usual": usual, "strength": strength}
    fit = GroupFit(**told, centre=np.full(count, strength, complex), pole=np.full(count, nominal))
    common = np.zeros((2, len(groups)))
    units = len(np.unique(field.array.unit))
    pose, covariance = np.zeros((units, 7)), np.zeros((7 * units, 7 * units))
    left, settled, echo = [np.inf], units == 1, 0.0
    for sweep in range(_SWEEPS):
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
                progress(sweep * len(groups) + group + 1, _SWEEPS * len(groups))
        if field.plate:
            echo = fit.fit_echo()
        common = fit.balance()
        left.append(float(np.mean([np.square(fit.residual(group)).mean() / fit.noise[group] for group in groups])))
        if sweep < 2:
            before = state.response.copy()
            absorb_displacement(fit.field, state, strength, usual)
            fit.turn(before)
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
    shift, shift_error = group_displacement(fit.field, state, dead)
    # Relative to the nominal positions, at the cells under the beam.
    stated, true = (transfer_matrix(cell_places(field, state.place), each.array) for each in (field, fit.field))
    response = state.response * (true * stated.conj()).sum(axis=0) / np.square(np.abs(stated)).sum(axis=0)
    response *= np.exp(-1j * np.angle(response[~dead].sum()))
    pole: Complex = np.where(dead, fit.pole, state.pole)
    errors[2:] = np.where(dead, usual.pole, errors[2:])
    scale = np.abs(fit.pole.real)
    noted = {
        **{f"sensor_{each.name}": float(getattr(state.place, each.name)) for each in fields(state.place)},
        **{"groups": len(fit.groups), "frames": field.codes.frames, "rate_hz": field.codes.rate},
        **{"noise_ratio": float(np.sqrt(worst)), "moved_m": shift, "moved_uncertainty_m": shift_error},
    }
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
        quality_uncertainty=np.hypot(errors[2], 0.0 if synchronous else usual.pole) * scale / np.abs(np.real(pole)),
        dead=dead,
        pose=pose,
        pose_covariance=covariance,
        reflection=state.place.reflection,
        reflection_uncertainty=float(np.sqrt(worst)) * echo,
        level_uncertainty=float(np.hypot(level_uncertainty / 2, level)),
        date=date,
        provenance=(provenance or Provenance()).then("fit array", noted),
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


_QUICK_SWEEPS = 2
"""Fits of each group; the calibration is a close start."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayCheck:
    """Changes of an array since its calibration; uncertainties are standard uncertainties (k = 1)."""

    dead: NDArray[np.int64]
    """Transducers that became silent."""
    drifted: NDArray[np.int64]
    """Transducers whose strength changed by more than 10 %, or whose phase by more than 0.1 rad, beyond 4 standard
    uncertainties."""
    offset: Array
    """Change of each unit's time offset from the mean of all units, in s, shape (unit,)."""
    offset_uncertainty: float
    warming: float
    """Difference of the air's temperature from the stated one in K, by the speed of sound."""
    warming_uncertainty: float

    def problems(self) -> list[str]:
        """Properties that have changed, one line each; empty if the calibration still holds."""
        found: list[str] = []
        for word, which in (("silent", self.dead), ("changed", self.drifted)):
            if len(which):
                some = ", ".join(map(str, which[:10])) + (" and more" if len(which) > 10 else "")
                found.append(f"{len(which)} transducers {word}: {some}; measure the array again")
        out = np.abs(self.offset)
        if (out > max(100e-9, 4 * self.offset_uncertainty)).any():
            unit = int(np.argmax(out))
            found.append(
                f"unit {unit} is {1e9 * self.offset[unit]:+.0f} ns out of step (± {2e9 * self.offset_uncertainty:.0f} "
                "ns, k = 2) or moved; start the units again, then measure the array again"
            )
        if abs(self.warming) > max(1.0, 4 * self.warming_uncertainty):
            found.append(
                f"the air is {self.warming:+.1f} K (± {2 * self.warming_uncertainty:.1f} K, k = 2) off the stated "
                "temperature; state it with --temperature"
            )
        return found


def check_array(
    field: ArrayField, samples: Array, known: ArrayCalibration, *, synchronous: bool = True, moved: float = 3e-3
) -> ArrayCheck:
    """Compare an array with its calibration by a short recording of codes; parameters as in `fit_array`.

    The responses are fitted from those of the calibration on. Their changes of phase are a sum of a displaced sensor
    (`moved` is its standard uncertainty in m), another speed of sound (a phase proportional to the distance), a step of
    each unit, and what is left for each transducer.

    Raises MismatchError if the calibration is of another array, InputError if the model does not explain the recording.
    """
    if not known.array.same_as(field.array):
        raise MismatchError(
            f"array check: expected a calibration of {field.array.name}, got one of {known.array.name} at other places"
        )
    groups, usual = range(len(field.codes.groups)), TransducerPrior(length=moved)
    state = ArrayState(known.response.copy(), known.pole.copy(), SensorPlace(z=field.height))
    measured = [field.spectrum(samples, group) for group in groups]
    fit_shared(field, measured[0], state, usual, synchronous=synchronous)
    strength = float(known.strength[~known.dead].mean())
    told: Any = {"field": field, "measured": measured, "state": state, "usual": usual, "strength": strength}
    fit = GroupFit(**told, centre=known.response, pole=known.pole)
    fit.slopes = [fit.slope(group) for group in groups]
    for _ in range(_QUICK_SWEEPS):
        for group in groups:
            fit.step(group)
        fit.balance()
    error = np.empty(field.array.count)
    for members, slope in zip(fit.groups, fit.slopes, strict=True):
        variance = np.diag(slope.covariance)[: 2 * len(members)].reshape(2, -1)
        error[members] = np.sqrt(variance.mean(axis=0))
    dead = ~known.dead & (np.abs(state.response) < DEAD * strength)
    alive = ~known.dead & ~dead
    size = np.where(alive, known.strength, strength)
    ratio = np.where(alive, state.response / np.where(alive, known.response, 1), 1)
    ratio /= np.median(np.abs(ratio[alive]))
    phase = np.angle(ratio * np.exp(-1j * np.angle(ratio[alive].sum())))
    sure = np.hypot(error / size, known.phase_uncertainty)
    smooth, shared, uncertain = _shared_changes(field, state.place, phase, sure, alive, moved)
    turned = np.abs(phase - smooth) > np.maximum(0.1, 4 * sure)
    louder = np.abs(np.abs(ratio) - 1) > np.maximum(0.1, 4 * np.hypot(error, known.strength_uncertainty) / size)
    turn, kelvin = 2 * np.pi * field.array.frequency, field.acoustics.medium.degrees + 273.15
    return ArrayCheck(
        dead=np.flatnonzero(dead),
        drifted=np.flatnonzero(alive & (turned | louder)),
        offset=shared[4:] / turn,
        offset_uncertainty=float(uncertain[4:].max() / turn),
        # The wave number falls with the speed of sound, which is proportional to the root of the temperature.
        warming=float(-2 * kelvin * shared[3]),
        warming_uncertainty=float(2 * kelvin * uncertain[3]),
    )


def _shared_changes(
    field: ArrayField, place: SensorPlace, phase: Array, sure: Array, alive: NDArray[np.bool_], moved: float
) -> tuple[Array, Array, Array]:
    """Fit displacement of the sensor in m, relative change of k, and phase of each unit; with their uncertainties.

    Weights fall with the residual (Huber, Robust Statistics, 1981), so that a few changed transducers have no effect.
    """
    way = np.array([place.x, place.y, place.z]) - field.array.position
    far = np.linalg.norm(way, axis=1, keepdims=True)
    k = wavenumber(field.array, field.acoustics.medium)
    units = [field.array.unit == name for name in np.unique(field.array.unit)]
    pattern = np.column_stack([k * way / far, k * far, *units]).astype(float)
    prior = np.diag([1 / moved**2] * 3 + [1e4] + [1 / 10**2] * len(units))
    found, covariance = np.zeros(pattern.shape[1]), prior
    for _ in range(5):
        score = np.abs(phase - pattern @ found) / sure
        weight = alive / np.maximum(score / 2, 1) / sure**2
        covariance = np.linalg.inv((pattern.T * weight) @ pattern + prior)
        found = covariance @ (pattern.T * weight) @ phase
    # The mean over the units is the common phase, which has no effect.
    keep = np.eye(len(found))
    keep[4:, 4:] -= 1 / len(units)
    return pattern @ found, keep @ found, np.sqrt(np.diag(keep @ covariance @ keep.T))
