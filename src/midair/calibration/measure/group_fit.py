"""Fit the transducers of an array, group by group, and the parameters that all share, to a recording of phase codes.

Shared are position of the sensor, softness of its gel, and overall strength. A displaced sensor delays the transducers
in a pattern, and a softer gel weakens those at the side. A fit of each transducer alone cannot separate this from real
differences between transducers, which are random. So these parameters are estimated twice: by Gauss-Newton with
identical transducers, and by projecting the fitted phases and strengths on the patterns. Their remaining uncertainty is
part of the uncertainty of each transducer.
"""

from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.calibration.measure.array_field import ArrayField, SensorPlace, cell_places
from midair.errors import InputError
from midair.physics import wavenumber

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
    k = wavenumber(field.array, field.acoustics.medium)
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
    slopes: list[Slope] = dataclass_field(default_factory=list[Slope])
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

    def shared(self, group: int, moved: Array) -> tuple[Array, Array]:
        """Information and gradient of unknowns that change the spectrum of a group by `moved` (value, unknown)."""
        slope, noise, rest = self.slopes[group], self.noise[group], self.residual(group)
        cross = slope.jacobian.T @ moved / noise
        solved = slope.covariance @ np.column_stack([cross, slope.jacobian.T @ rest / noise])
        share = min(1.0, noise / float(np.square(rest).mean()))  # A remainder above the noise tells nothing
        information = moved.T @ moved / noise - cross.T @ solved[:, :-1]
        return share * information, share * (moved.T @ rest / noise - cross.T @ solved[:, -1])

    def fit_echo(self) -> float:
        """One Gauss-Newton step of the reflection factor of the array's face; returns the uncertainty of either part.

        The responses keep the sound at the cells as it is: the echo is told by what it does differently on each cell.
        """
        model, state, place = self.field, self.state, self.state.place
        cells = cell_places(model, place)
        G, echo = model.field(cells, place), model.echo(cells, place)
        absorbed = (G.conj() * echo).sum(axis=0) / np.square(np.abs(G)).sum(axis=0)
        information, gradient = np.eye(2), -np.array([place.echo, place.echo_imag])
        for group in range(len(self.slopes)):
            rest, columns = self.residual(group), list[Array]()
            for turned in (1, 1j):
                step = _ECHO * turned
                changed = replace(place, echo=place.echo + step.real, echo_imag=place.echo_imag + step.imag)
                moved = ArrayState(state.response * (1 - step * absorbed), state.pole, changed)
                columns.append((replace(self, state=moved).residual(group) - rest) / -_ECHO)
            told, towards = self.shared(group, np.column_stack(columns))
            information, gradient = information + told, gradient + towards
        covariance = np.linalg.inv(information)
        change = covariance @ gradient
        before = state.response.copy()
        state.response = before * (1 - complex(*change) * absorbed)
        state.place = replace(place, echo=place.echo + float(change[0]), echo_imag=place.echo_imag + float(change[1]))
        self.turn(before)
        return float(np.sqrt(covariance.trace() / 2))


_ECHO = 0.05
"""Step of the reflection factor for differences."""
