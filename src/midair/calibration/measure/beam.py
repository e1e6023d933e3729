"""Measure a calibration with a focused beam on every cell, without a reference (paper, 5.2, generalised).

The paper sets the gain "so that the focused beam to the sensor just below the AUTD center produces an expected output
amplitude": one cell, one level. Here each cell gets the beam at five levels or more and many frequencies at once, and
the output is regressed on the commanded PRESSURE with an intercept. The absolute level depends on the array's model;
the differences between channels do not.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from midair.array_types import Array, Complex
from midair.calibration.measure.frequency_response import (
    bend_uncertainty,
    channel_delay,
    fit_levels,
    quiet_density,
    upper_half,
    white_level,
    widened,
)
from midair.errors import InputError, ShapeError
from midair.model import (
    BAND,
    HEIGHT,
    HEIGHTS,
    RATE,
    Acoustics,
    Calibration,
    ControlGrid,
    Crosstalk,
    Linearity,
    Measurement,
    Recording,
    SensorGrid,
    TransducerArray,
)
from midair.physics import SensorModel, cell_weights, focus_phase, radiation_pressure, transfer_matrix
from midair.validation import length, positive, within


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamPlan:
    """Multi-tone pressure at several levels in sequence, the same for each cell."""

    top: float = 100.0
    """Peak pressure of the strongest level at the focus, in Pa."""
    levels: int = 6
    """Number of levels, evenly spaced in pressure; 5 or more."""
    low: float = BAND[0]
    """First tone in Hz, a multiple of `spacing`."""
    high: float = BAND[1]
    """Last tone in Hz, a multiple of `spacing`."""
    spacing: float = 5.0
    """Distance of the tones up to 60 Hz, in Hz; twice that above. The measurement window is 1 / spacing."""
    settle: float = 0.1
    """Settling time before the window of each level, in s."""
    guard: float = 0.02
    """Time after the window of each level, in s, because the beam may begin one frame early."""
    rate: float = RATE
    """Frame rate of the drive in Hz, a whole multiple of `spacing`."""

    def __post_init__(self) -> None:
        positive(self.top, "highest pressure", "Pa")
        positive(self.settle, "time to settle", "s")
        positive(self.guard, "guard", "s")
        within(self.levels, "levels", 5, advice="fewer cannot show a nonlinearity")
        for name in ("low", "high", "rate"):
            ratio = getattr(self, name) / positive(self.spacing, "spacing of the tones", "Hz")
            if ratio < 1 or abs(ratio - round(ratio)) > 1e-9:
                raise InputError(f"{name}: expected a multiple of {self.spacing:g} Hz, got {getattr(self, name):g} Hz")
        if not self.low < self.high < self.rate / 2:
            raise InputError(
                f"tones: expected them below {self.rate / 2:g} Hz, half the rate, got {self.low:g} to {self.high:g} Hz"
            )

    @property
    def tones(self) -> Array:
        """Frequencies of the tones in Hz, shape (tone,)."""
        close = np.arange(self.low, min(60.0, self.high) - self.spacing / 2, self.spacing)
        far = np.arange(max(60.0, self.low), self.high - self.spacing, 2 * self.spacing)
        return np.unique(np.concatenate([close, far, [self.high]]).round(9))

    @property
    def window(self) -> int:
        """Length of the measurement window of each level in frames: whole periods of every tone."""
        return round(self.rate / self.spacing)

    @property
    def stretch(self) -> int:
        """Frames per level."""
        return round(self.settle * self.rate) + self.window + round(self.guard * self.rate)

    @property
    def waveform(self) -> Array:
        """Pressure of all levels over `top`, shape (frame,), 0 to 1.

        1 + sum a cos(2 pi f_n t + phi_n), with Schroeder's phases phi_n = -pi n (n - 1) / N, which keep the peaks low.
        """
        tones = self.tones
        number = np.arange(1, len(tones) + 1)
        phase = -np.pi * number * (number - 1) / len(tones)
        time = np.arange(self.stretch) / self.rate
        wave = np.cos(2 * np.pi * tones[:, None] * time + phase[:, None]).sum(axis=0)
        # Shifted to 0 or more, because radiation pressure is never negative.
        one = (wave - wave.min()) / np.ptp(wave)
        return (np.arange(1, self.levels + 1)[:, None] / self.levels * one).ravel()


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamSetting:
    """Position of the sensor under the array and averaging of its cells, with standard uncertainties."""

    height: float = HEIGHT
    """Height of the sensor above the array, in m."""
    centre: tuple[float, float] = (0.0, 0.0)
    """(x, y) of the sensor's centre, in m."""
    placement_uncertainty: float = 0.5e-3
    """Uncertainty of the centre, in m."""
    aperture: float = 8e-3
    """Side of the square over which a cell averages, in m."""
    aperture_uncertainty: float = 0.25e-3
    spread: float = 1e-3
    """Standard deviation of the gel's point spread, in m."""
    spread_uncertainty: float = 0.25e-3
    pressure_uncertainty: float = 0.15
    """Relative uncertainty of the array's radiation pressure: twice that of its sound pressure."""
    dynamics_uncertainty: float = 0.2
    """Relative uncertainty of the attenuation of each tone by the transducers' dynamics."""

    def __post_init__(self) -> None:
        length(self.height, "height", HEIGHTS)


def focus_position(sensor: SensorGrid, cell: int, setting: BeamSetting) -> Array:
    """Position of the focus for a cell, shape (3,), in m."""
    x, y = sensor.channel_position(cell)
    return np.array([x + setting.centre[0], y + setting.centre[1], setting.height])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamField:
    """Modelled pressure around a sensor for a focus of the whole array, at full drive, on each of its cells.

    The points are a twelfth of the sensor's pitch apart. `pressure` has the shape (point, focused cell) and `middle`,
    the pressure at each focus, (focused cell,), both in Pa.
    """

    sensor: SensorGrid
    points: ControlGrid
    pressure: Array
    middle: Array

    def on_cells(self, setting: BeamSetting, *, offset: tuple[float, float] = (0.0, 0.0)) -> Array:
        """Mean pressure on each cell in Pa, shape (cell, focused cell), for a sensor displaced by `offset` in m."""
        model = SensorModel(grid=self.sensor, aperture=setting.aperture, spread=setting.spread)
        at = (setting.centre[0] + offset[0], setting.centre[1] + offset[1])
        return cell_weights(model, self.points, centre=at) @ self.pressure

    def changed(self, setting: BeamSetting) -> Array:
        """`on_cells` with each length changed by its standard uncertainty, shape (cause, cell, focused cell)."""
        away = setting.placement_uncertainty
        wider = replace(setting, aperture=setting.aperture + setting.aperture_uncertainty)
        softer = replace(setting, spread=setting.spread + setting.spread_uncertainty)
        beside = [self.on_cells(setting, offset=offset) for offset in ((away, 0.0), (0.0, away))]
        return np.array([self.on_cells(wider), self.on_cells(softer), *beside])


def beam_field(
    array: TransducerArray, sensor: SensorGrid, setting: BeamSetting, *, acoustics: Acoustics | None = None
) -> BeamField:
    """Compute the pressure around a sensor for a focus on each of its cells."""
    acoustics = acoustics or Acoustics()
    around = ControlGrid(
        # One more cell on every side, because the focus on an outer cell extends beyond the sensor.
        rows=12 * (sensor.rows + 2),
        columns=12 * (sensor.columns + 2),
        pitch=sensor.pitch / 12,
        height=setting.height,
        centre=setting.centre,
    )
    foci = np.array([focus_position(sensor, cell, setting) for cell in range(sensor.count)])
    drives = np.exp(1j * np.array([focus_phase(array, focus, acoustics=acoustics) for focus in foci])).T
    # 512 points at a time, because the whole matrix of a fine grid would take hundreds of megabytes.
    parts = [
        transfer_matrix(some, array, acoustics=acoustics) @ drives
        for some in np.array_split(around.position, max(1, around.count // 512))
    ]
    middle = np.abs(transfer_matrix(foci, array, acoustics=acoustics)).sum(axis=1)
    return BeamField(
        sensor=sensor,
        points=around,
        pressure=radiation_pressure(np.concatenate(parts), acoustics.medium),
        middle=radiation_pressure(middle, acoustics.medium),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamReading:
    """Commanded pressure and measured output for a beam on every cell."""

    plan: BeamPlan
    commanded: Complex
    """Modelled pressure at the focus in Pa (mean of all foci, with the transducers' dynamics), shape (level, tone)."""
    output: Complex
    """Output of the sensor in its unit, shape (cell, level, tone, channel)."""
    shares: Array
    """Mean pressure on each cell over the commanded one, shape (cell, focused cell)."""
    changed_shares: Array
    """The shares with each uncertain length changed by its standard uncertainty, shape (cause, cell, focused cell)."""
    slow: Array
    """Relative standard uncertainty of the command from the transducers' dynamics, shape (tone,)."""
    level: float
    """Relative standard uncertainty that all commands share."""
    timing: float
    """Standard uncertainty of the start time of the beam, in s."""


def tone_amplitudes(signal: Array, rate: float, plan: BeamPlan, *, lag: int = 0) -> Complex:
    """Complex amplitude of each tone at each level from its measurement window, shape (level, tone, channel).

    The amplitude is the peak 2 / N sum y e^(-j 2 pi f t), with t from the start of the window.

    `signal`, shape (frame, channel), comes `lag` of its frames late; its `rate` in Hz is a whole multiple of the
    plan's. Raises ShapeError if it is shorter than the plan.
    """
    steps = round(rate / plan.rate)
    window, stretch = plan.window * steps, plan.stretch * steps
    starts = lag + stretch * np.arange(plan.levels) + round(plan.settle * plan.rate) * steps
    if starts[-1] + window > len(signal):
        raise ShapeError(
            f"recording: expected {(starts[-1] + window) / rate:.3g} s of beam or more, got {len(signal) / rate:.3g} s"
        )
    turn = np.exp(-2j * np.pi * plan.tones[:, None] * np.arange(window) / rate)
    heard = np.stack([signal[start : start + window] for start in starts])
    return np.asarray(2 / window * np.einsum("fn,lnc->lfc", turn, heard), np.complex128)


def find_lag(signal: Array, expected: Array) -> int:
    """Find the number of frames before the beam begins, at the maximum of the cross-correlation with the command.

    `signal` (frame,) is the output of the channel under the beam; `expected` (frame,), the commanded pressure at the
    same rate, is not longer.
    """
    if len(expected) > len(signal):
        raise ShapeError(f"recording: expected {len(expected)} frames of beam or more, got {len(signal)}")
    alike = scipy.signal.correlate(signal - signal.mean(), expected - expected.mean(), mode="valid")
    # The magnitude also works for a sensor whose output falls with pressure.
    return int(np.argmax(np.abs(alike)))


def measure_beam(
    reading: BeamReading, *, sensor: Recording, quiet: Recording, date: str = "", version: int = 1
) -> Calibration:
    """Measure a sensor's calibration from a beam on each of its cells.

    With M_ik the slope of channel i over the pressure in a focus on cell k, and B_lk the pressure on cell l for that
    focus, M = diag(H) C B, so H and the crosstalk C follow from M B^-1. The uncertainty of H combines the scatter about
    the line, the lengths that determine B (each changed by its standard uncertainty), and the array's level and
    dynamics.

    `sensor` is any of the recordings, which provides grid, unit and provenance; `quiet` is one without any sound.
    Raises InputError if a channel does not measure the beam.
    """
    slope, spread, explained = _slopes(reading)
    inverse = np.linalg.inv(reading.shares)
    whole = slope @ inverse
    cells = np.arange(sensor.sensor.count)
    response = whole[:, cells, cells]
    density, noise, noise_error = _noise(quiet, reading.plan)
    random = np.abs(inverse[cells, cells] * spread[:, cells, cells]) / np.abs(response)
    worst = np.median(random, axis=0)
    if not (worst < 0.5).all():
        deaf = ", ".join(str(channel) for channel in np.flatnonzero(~(worst < 0.5)))
        raise InputError(
            f"beam: expected a signal on every channel, got none on channels {deaf}; point the beam at the sensor"
        )
    geometry, common = _from_lengths(reading, slope, response)
    linearity, bend = _linearity(reading, response, density, sensor.sensor.shape)
    fixed = reading.level**2 + bend**2 + random**2 + geometry**2
    magnitude = np.sqrt(fixed + reading.slow[:, None] ** 2)
    # The shared uncertainty must not exceed that of the most certain channel.
    shared = min(float(np.hypot(reading.level, common)), float(magnitude.min()))
    turn = 2 * np.pi * reading.plan.tones[:, None] * reading.timing
    phase = np.sqrt(random**2 + turn**2)
    upper = upper_half(reading.plan.tones)
    delay, delay_error = channel_delay(reading.plan.tones[upper], response[upper], random[upper])
    shape = sensor.sensor.shape
    details = {"levels": reading.plan.levels, "top_pa": reading.plan.top, "pressure_uncertainty": reading.level}
    return Calibration(
        sensor=sensor.sensor,
        frequency=reading.plan.tones,
        response=response.reshape(-1, *shape),
        noise=noise.reshape(shape),
        unit=sensor.unit,
        date=date,
        version=version,
        provenance=sensor.provenance.then("measure beam", details),
        measurement=Measurement(
            coherence=explained[:, cells, cells].reshape(-1, *shape),
            magnitude_uncertainty=magnitude.reshape(-1, *shape),
            phase_uncertainty=phase.reshape(-1, *shape),
            noise_density=density.reshape(-1, *shape),
            noise_uncertainty=noise_error.reshape(shape),
            delay=delay.reshape(shape),
            delay_uncertainty=np.hypot(delay_error, reading.timing).reshape(shape),
            reference_uncertainty=shared,
            reference="the array's model",
            method=f"a focused beam on each cell, {reading.plan.levels} levels, {len(reading.plan.tones)} tones",
            takes=sensor.sensor.count,
        ),
        crosstalk=_crosstalk(reading, slope, spread),
        linearity=linearity,
    )


def _slopes(reading: BeamReading) -> tuple[Complex, Array, Array]:
    """M, the standard uncertainty of each of its parts, and the share of the output's power that the line explains.

    All have the shape (tone, channel, focused cell).
    """
    x = np.moveaxis(reading.commanded, 0, -1)
    design = np.stack([x, np.ones_like(x)], axis=-1)
    pseudo = np.linalg.pinv(design)
    y = np.einsum("kltc->tclk", reading.output)
    found = np.einsum("tpl,tclk->tcpk", pseudo, y)
    rest = y - np.einsum("tlp,tcpk->tclk", design, found)
    # Each complex number has two degrees of freedom; the line uses two complex numbers.
    free = 2 * (len(reading.commanded) - 2)
    left, power = (np.square(np.abs(each)).sum(axis=2) for each in (rest, y))
    scatter = np.sqrt(left / free)
    error = scatter * np.sqrt((np.abs(pseudo[:, 0]) ** 2).sum(axis=-1))[:, None, None]
    return found[:, :, 0], widened(error, free), np.clip(1 - left / np.maximum(power, 1e-300), 0, 1)


def _from_lengths(reading: BeamReading, slope: Complex, response: Complex) -> tuple[Array, float]:
    """Relative uncertainty of H from the lengths, shape (channel,), and the part that all channels share."""
    cells = np.arange(response.shape[1])
    changes = [
        np.abs((slope @ np.linalg.inv(shares))[:, cells, cells] / response).mean(axis=0) - 1
        for shares in reading.changed_shares
    ]
    if not changes:
        return np.zeros(len(cells)), 0.0
    each = np.array(changes)
    return np.sqrt((each**2).sum(axis=0)), float(np.sqrt((each.mean(axis=1) ** 2).sum()))


def _crosstalk(reading: BeamReading, slope: Complex, spread: Array) -> Crosstalk:
    """C_ik from M B^-1, averaged over the tones, with the uncertainty from scatter and lengths."""
    inverse = np.linalg.inv(reading.shares)
    whole = _ratio(slope @ inverse)
    own = np.abs(np.einsum("tcc->tc", slope @ inverse))
    gain = np.linalg.norm(inverse, axis=0)
    noise = np.sqrt((((spread * gain) / own[:, :, None]) ** 2).mean(axis=0) / len(slope))
    changed = [_ratio(slope @ np.linalg.inv(shares)) - whole for shares in reading.changed_shares]
    uncertainty = np.sqrt(noise**2 + sum(change**2 for change in changed))
    np.fill_diagonal(uncertainty, 0)
    return Crosstalk(matrix=whole, uncertainty=uncertainty)


def _ratio(whole: Complex) -> Array:
    own = np.einsum("tcc->tc", whole)
    matrix = (whole / own[:, :, None]).real.mean(axis=0)
    np.fill_diagonal(matrix, 1)
    return matrix


def _own(reading: BeamReading) -> Complex:
    """Output of each channel for a beam on its own cell, shape (level, tone, channel)."""
    return np.moveaxis(np.einsum("cltc->clt", reading.output), 0, -1)


def _linearity(
    reading: BeamReading, response: Complex, density: Array, cells: tuple[int, int]
) -> tuple[Linearity, Array]:
    """Linearity of each cell over all tones together, and its contribution to the uncertainty."""
    own = np.diag(reading.shares)
    pressed = reading.commanded[..., None] * own
    predicted = response * pressed
    power = (np.abs(predicted) ** 2).sum(axis=1)
    share = (predicted.conj() * _own(reading)).real.sum(axis=1) / power
    rms = np.sqrt((np.abs(pressed) ** 2).sum(axis=1) / 2)
    # Crosstalk from neighbouring cells is the same relative part at every level.
    share = share / share.mean(axis=0)
    # White noise of density n gives a tone's amplitude a mean square error of 2 n^2 / (length of the window).
    hidden = density**2 * reading.plan.spacing
    error = np.sqrt((np.abs(predicted) ** 2 * hidden).sum(axis=1)) / power
    shape = (len(share), *cells)
    line = fit_levels(*(values.reshape(shape) for values in (rms, share * rms, error * rms)))
    slopes = share - line.intercept.ravel() / rms
    return line, bend_uncertainty(slopes / slopes.mean(axis=0), error)


def _noise(quiet: Recording, plan: BeamPlan) -> tuple[Array, Array, Array]:
    width = max(4 * plan.spacing, 16 / quiet.duration)
    bins, power, averages = quiet_density(quiet, resolution=width / 2, width=width)
    # The factor 2: each band is twice as wide as the band spacing.
    level, error = white_level(power, averages, 2.0)
    return np.sqrt(np.stack([np.interp(plan.tones, bins, one) for one in power.T], axis=1)), level, error
