"""Gauss-Newton steps for the transducers of an array, group by group, in a recording of phase codes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.calibration.measure.array_field import ArrayField
from midair.calibration.measure.shared_parameters import (
    ArrayState,
    TransducerPrior,
    predicted_spectrum,
    real_parts,
    sound_at_points,
)

_STEP = 0.3
"""Longest step of a pole, relative to one over the time constant."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slope:
    """Jacobian (number, unknown) and posterior covariance of a group's responses and scaled poles."""

    jacobian: Array
    covariance: Array


@dataclass(slots=True, kw_only=True, eq=False)
class GroupFit:
    """The recording, the current estimates, and the prior of every transducer."""

    field: ArrayField
    """Its array has the current positions of the units."""
    measured: list[Complex]
    """Measured spectrum of each group's window, shape (bin, cell)."""
    state: ArrayState
    usual: TransducerPrior
    strength: float
    """Mean strength, the unit of the prior."""
    centre: Complex
    """Prior mean of each response, shape (transducer,)."""
    pole: Complex
    """Prior mean of each pole in rad/s, shape (transducer,)."""
    slopes: list[Slope]
    """Slope of each group, in their order."""

    @property
    def groups(self) -> tuple[NDArray[np.int64], ...]:
        """Transducers of each group."""
        return self.field.codes.groups

    @property
    def noise(self) -> Array:
        """Variance of the real or the imaginary part of a bin for each group, shape (group,)."""
        model = self.field
        density = float(np.sqrt((model.calibration.noise.ravel()[list(model.codes.cells)] ** 2).mean()))
        frames = np.array([end - begin for begin, end in map(model.window, range(len(self.groups)))])
        frames = frames * model.rate / model.codes.rate
        # Variance of a bin of the normalised FFT: variance of a sample (n^2 times half the rate) over the number of
        # frames, one half each in the real and the imaginary part.
        return np.maximum(density, 1e-12) ** 2 * model.rate / 2 / frames / 2

    def residual(self, group: int) -> Array:
        """Measured minus predicted spectrum of a group's window: real and imaginary parts, cell after cell."""
        rest = self.measured[group] - predicted_spectrum(self.field, group, self.state)
        return np.concatenate([real_parts(cell) for cell in rest.T])

    def belief(self, group: int) -> Array:
        """Prior standard deviations of a group's unknowns."""
        return np.repeat([self.usual.response * self.strength, self.usual.pole], 2 * len(self.groups[group]))

    def unknowns(self, group: int) -> Array:
        """Differences of a group's responses and scaled poles from the means of the prior."""
        members = self.groups[group]
        response = (self.state.response - self.centre)[members]
        pole = ((self.state.pole - self.pole) / np.abs(self.pole.real))[members]
        return np.concatenate([response.real, response.imag, pole.real, pole.imag])

    def slope(self, group: int) -> Slope:
        """Jacobian and covariance of a group at the current estimates."""
        model, state, members = self.field, self.state, self.groups[group]
        G, weights = model.matrix(state.place)
        q, change = model.followed(group, state.pole[members])
        sound = sound_at_points(model, group, state, G, q)
        moving = change * state.response[members] * np.abs(self.pole.real[members])
        rows: list[Array] = []
        for cell, weight in enumerate(weights):
            near = np.abs(weight) > 1e-4 * weight.max()
            across = 2 * (sound[:, near].conj() * weight[near]) @ G[np.ix_(near, members)]
            parts = [across * q, across * moving]
            columns = np.concatenate([part for each in parts for part in (each.real, -each.imag)], axis=1)
            bins, answer = model.answer(group, state.place)
            spectrum = np.fft.rfft(columns, axis=0)[bins] / len(columns) * answer[:, cell, None]
            rows.append(real_parts(spectrum))
        jacobian = np.concatenate(rows)
        information = jacobian.T @ jacobian / self.noise[group]
        information[np.diag_indices_from(information)] += 1 / self.belief(group) ** 2
        return Slope(jacobian=jacobian, covariance=np.linalg.inv(information))

    def step(self, group: int) -> None:
        """One Gauss-Newton step for the unknowns of a group, with the other groups fixed."""
        slope, members = self.slopes[group], self.groups[group]
        pull = self.unknowns(group) / self.belief(group) ** 2
        change = slope.covariance @ (slope.jacobian.T @ self.residual(group) / self.noise[group] - pull)
        real, imag, slow, turning = change.reshape(4, -1)
        self.state.response[members] += real + 1j * imag
        scale = np.abs(self.pole.real[members])
        # The output is not linear in a pole: full steps of some transducers would oscillate and never converge.
        shorter = np.minimum(1, _STEP / np.maximum(np.hypot(slow, turning), 1e-12))
        pole = self.state.pole[members] + scale * shorter * (slow + 1j * turning)
        # Keep the pole stable: a step that is too large would make the response grow.
        self.state.pole[members] = np.minimum(pole.real, -0.2 * scale) + 1j * pole.imag

    def turn(self, before: Complex) -> None:
        """Turn the slopes after a displacement that the responses absorbed, from `before` to those of the state.

        The field of each transducer turned by the opposite phase, so its derivatives turn as the response did.
        """
        for members, slope in zip(self.groups, self.slopes, strict=True):
            turned, count = before[members] / self.state.response[members], len(members)
            turned /= np.abs(turned)
            for rows in (slope.jacobian, slope.covariance, slope.covariance.T):
                real, imag = rows[:, :count].copy(), rows[:, count : 2 * count].copy()
                rows[:, :count] = real * turned.real + imag * turned.imag
                rows[:, count : 2 * count] = imag * turned.real - real * turned.imag

    def balance(self) -> Array:
        """Fit one complex factor per group to all windows together; return its uncertainty, shape (2, group).

        Fitting the groups in turn converges slowly, because each fit takes the other groups as exact.
        """
        model, state, groups = self.field, self.state, self.groups
        if len(groups) == 1:
            return np.zeros((2, 1))
        G, weights = model.matrix(state.place)
        still = model.codes.level * np.exp(1j * model.codes.still) * state.response
        steady = np.stack([G[:, members] @ still[members] for members in groups])
        belief = np.sqrt([len(members) for members in groups]) / self.usual.response
        information, gradient = np.diag(np.tile(belief, 2) ** 2), np.zeros(2 * len(groups))
        for group, (members, heard) in enumerate(zip(groups, self.measured, strict=True)):
            q = model.followed(group, state.pole[members])[0]
            moving = q @ (G[:, members] * state.response[members]).T
            sound = steady.sum(axis=0) - steady[group] + moving
            columns = np.empty((len(sound), len(weights), 2 * len(groups)))
            for other in range(len(groups)):
                product = 2 * (sound.conj() * (moving if other == group else steady[other])) @ weights.T
                columns[..., other], columns[..., len(groups) + other] = product.real, -product.imag
            slope = real_parts(model.predicted(columns, group, state.place)).reshape(-1, 2 * len(groups))
            rest = heard - model.predicted(np.abs(sound) ** 2 @ weights.T, group, state.place)
            information += slope.T @ slope / self.noise[group]
            gradient += slope.T @ real_parts(rest).ravel() / self.noise[group]
        covariance = np.linalg.inv(information)
        change = covariance @ gradient
        for members, along, across in zip(groups, change[: len(groups)], change[len(groups) :], strict=True):
            state.response[members] *= 1 + along + 1j * across
        # A phase that all groups share has no effect on the output and is no error.
        keep = np.eye(len(groups)) - 1 / len(groups)
        part = covariance[len(groups) :, len(groups) :]
        across = np.sqrt(np.diag(keep @ part @ keep.T))
        return np.stack([np.sqrt(np.diag(covariance)[: len(groups)]), across])
