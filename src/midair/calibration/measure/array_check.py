"""Check within two seconds of codes whether the calibration of an array still holds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.calibration.measure.array_field import ArrayField, SensorPlace
from midair.calibration.measure.group_fit import GroupFit
from midair.calibration.measure.shared_parameters import DEAD, ArrayState, TransducerPrior, fit_shared
from midair.errors import MismatchError
from midair.model import ArrayCalibration
from midair.physics import wavenumber

_SWEEPS = 2
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
        """What no longer holds, one line each; empty if the calibration still holds."""
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

    Raises
    ------
    MismatchError
        If the calibration is of another array.
    InputError
        If the model does not explain the recording.
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
    fit = GroupFit(
        field=field,
        measured=measured,
        state=state,
        usual=usual,
        strength=strength,
        centre=known.response,
        pole=known.pole,
        slopes=[],
    )
    fit.slopes = [fit.slope(group) for group in groups]
    for _ in range(_SWEEPS):
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
