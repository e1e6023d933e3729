"""Response of the tactile sensor to pressure: gel, cavity, microphone, converter (paper, section 3).

Pressure on the gel sheet spreads sideways and compresses the air of a cavity, whose pressure a microphone measures. One
channel is the chain

    H(f) = s g * 1 / (1 + j 2 pi f tau) * (j f / f_h) / (1 + j f / f_h) * 1 / (1 - (f / f_r)^2 + j f / (Q f_r))

with s the sensitivity, g the channel's own gain, tau the relaxation of the gel (a Kelvin-Voigt layer), f_h the lower
corner frequency of the microphone and the leak of its cavity, and f_r and Q the resonance of the cavity (a Helmholtz
resonator; Kinsler et al., Fundamentals of Acoustics, 10.8). Optional: crosstalk between cells, delays of channels,
saturation of the amplifier. Then follow noise, clipping and quantisation. The paper gives no figures for these; the
defaults are plausible, not measured.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from types import MappingProxyType
from typing import Literal

import numpy as np

from midair.array_types import Array, Complex
from midair.dsp import fast_length
from midair.errors import InputError, ShapeError
from midair.model import Calibration, ControlGrid, Crosstalk, Provenance, SensorGrid
from midair.streaming import Stored
from midair.validation import frozen_array, one_of, positive, within


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensorModel:
    """One tactile sensor."""

    grid: SensorGrid = field(default_factory=SensorGrid)
    spread: float = 1e-3
    """Standard deviation of the Gaussian with which the gel spreads a point of pressure, in m."""
    aperture: float = 8e-3
    """Side of the square over which one cell averages, in m."""
    relaxation: float = 0.2e-3
    """tau of the gel in s; 0 for none."""
    sensitivity: float = 20e-3
    """s in V/Pa."""
    high_pass: float = 20.0
    """f_h in Hz."""
    resonance: float = 1500.0
    """f_r in Hz."""
    quality: float = 1.5
    """Q."""
    gain: Array = field(default_factory=lambda: np.ones(0))
    """g of each channel, shape (row, column); empty for 1."""
    corner: Array = field(default_factory=lambda: np.ones(0))
    """Factor on f_h of each channel, shape (row, column); empty for 1."""
    noise: float = 20e-6
    """One-sided density of the white noise at the output, in V/sqrt(Hz)."""
    full_scale: float = 5.0
    """Largest voltage of the converter, either sign, in V."""
    bits: int = 16
    """Resolution of the converter."""
    delay: Array = field(default_factory=lambda: np.zeros(0))
    """Delay of each channel in s, 0 or more, shape (row, column), as of a multiplexed converter; empty for none."""
    crosstalk: Array = field(default_factory=lambda: np.zeros((0, 0)))
    """Pressure measured by cell i over the pressure on cell k, shape (channel, channel); empty for none."""
    saturation: float = np.inf
    """Limit v_s of the microphone's amplifier, v_s tanh(v / v_s), in V."""

    def __post_init__(self) -> None:
        units = {"spread": "m", "aperture": "m", "sensitivity": "V/Pa", "high_pass": "Hz", "resonance": "Hz"}
        for name, unit in {**units, "quality": "", "full_scale": "V"}.items():
            positive(getattr(self, name), f"{name} of the sensor", unit)
        for name, unit in (("relaxation", "s"), ("noise", "V/sqrt(Hz)")):
            within(getattr(self, name), f"{name} of the sensor", 0, unit=unit)
        if not 1 <= self.bits <= 32 or self.bits != int(self.bits):
            raise InputError(f"bits of the sensor: expected a whole number from 1 to 32, got {self.bits}")
        for name in ("gain", "corner"):
            value = getattr(self, name)
            factors = frozen_array(value if np.size(value) else np.ones(self.grid.shape), name, self.grid.shape)
            if factors.min() <= 0:
                raise InputError(f"{name} of the sensor: expected factors above 0, got {factors.min():g}")
            object.__setattr__(self, name, factors)
        if not self.saturation > 0:
            raise InputError(f"saturation of the sensor: expected above 0 V, got {self.saturation:g} V")
        delay = self.delay if np.size(self.delay) else np.zeros(self.grid.shape)
        crosstalk = self.crosstalk if np.size(self.crosstalk) else np.eye(self.grid.count)
        object.__setattr__(self, "delay", frozen_array(delay, "delay", self.grid.shape))
        object.__setattr__(self, "crosstalk", frozen_array(crosstalk, "crosstalk", (self.grid.count, self.grid.count)))
        if self.delay.min() < 0:
            raise InputError(f"delay of the sensor: expected 0 s or more, got {self.delay.min():g} s")

    @classmethod
    def usual(cls, grid: SensorGrid) -> "SensorModel":
        """The usual sensor with these cells; the aperture scales with the pitch, 8 mm at 11 mm."""
        return cls(grid=grid, aperture=8e-3 * (grid.pitch / 11e-3))

    def with_spread(self, *, seed: int, gain: float = 0.1, corner: float = 0.1) -> "SensorModel":
        """The same sensor with random differences between channels, as in real sensors.

        `gain` and `corner` are standard deviations of the natural logarithm of each channel's factor.
        """
        rng = np.random.default_rng(seed)
        return replace(
            self,
            gain=np.exp(gain * rng.standard_normal(self.grid.shape)),
            corner=np.exp(corner * rng.standard_normal(self.grid.shape)),
        )

    @property
    def step(self) -> float:
        """Quantisation step of the converter, in V."""
        return float(2 * self.full_scale / 2**self.bits)


def channel_response(model: SensorModel, frequency: Array) -> Complex:
    """H(f), output over pressure of every channel, in V/Pa, shape (bin, row, column), for frequencies (bin,) in Hz."""
    f = np.asarray(frequency, float)[:, None, None]
    gel = 1 / (1 + 2j * np.pi * f * model.relaxation)
    cavity = 1 / (1 - (f / model.resonance) ** 2 + 1j * f / (model.quality * model.resonance))
    over = 1j * f / (model.high_pass * model.corner)
    late = np.exp(-2j * np.pi * f * model.delay)
    return np.asarray(model.sensitivity * model.gain * gel * cavity * over / (1 + over) * late, np.complex128)


def sense(
    model: SensorModel, pressure: Array, rate: float, *, rng: np.random.Generator | None = None, oversample: int = 1
) -> Array:
    """Output of the sensor for a pressure on its cells.

    H(f) is applied to the spectrum of the pressure, which is assumed band-limited between samples, 0 before the first
    one (so the start is the transient of a sensor at rest), and held after the last one, then faded out. The record is
    padded until the slowest part of H has decayed to 1e-8. Every frequency below half the output rate gets H(f) itself;
    frequencies above are removed (an ideal anti-alias filter).

    `pressure` on the cells, shape (frame, row, column), in Pa, has `oversample` frames per sample of the output. The
    result, shape (ceil(frame / oversample), row, column), is in V, clipped and quantised; sample i is at i / rate.
    There is no noise if `rng` is None. Raises ShapeError if the shape of the pressure does not match the sensor.
    """
    if oversample < 1 or oversample != int(oversample):
        raise InputError(f"oversample: expected a whole number, 1 or more, got {oversample}")
    positive(rate, "rate", "Hz")
    pressure = np.asarray(pressure, float)
    if pressure.ndim != 3 or not len(pressure) or pressure.shape[1:] != model.grid.shape:
        raise ShapeError(
            f"pressure: expected shape (frame, {model.grid.rows}, {model.grid.columns}), got {pressure.shape}"
        )
    return sensor_output(model, _respond(model, cell_pressure(model, pressure), rate, oversample), rate, rng=rng)


def sensor_output(model: SensorModel, volts: Array, rate: float, *, rng: np.random.Generator | None = None) -> Array:
    """Apply amplifier, noise and converter to voltages, shape (frame, row, column), in V; as in `sense`."""
    if np.isfinite(model.saturation):
        volts = model.saturation * np.tanh(volts / model.saturation)
    if rng is not None:
        # White noise of one-sided density n has the variance n^2 rate / 2.
        volts = volts + model.noise * np.sqrt(rate / 2) * rng.standard_normal(volts.shape)
    # The converter clips and rounds to the codes -2^(bits-1) to 2^(bits-1) - 1.
    half = 2.0 ** (model.bits - 1)
    return np.clip(np.rint(volts / model.step), -half, half - 1) * model.step


def calibration_of(model: SensorModel, *, highest: float = 4000.0, bins: int = 1024) -> Calibration:
    """The model's own response as a calibration, the result of an ideal measurement.

    Besides 0 Hz it has `bins` frequencies, logarithmic from 1 Hz to `highest` (Hz); 1024 interpolate to better than
    3e-5 above 1 Hz.
    """
    frequency = np.concatenate([[0.0], np.geomspace(1.0, positive(highest, "highest", "Hz"), bins)])
    alone = (model.crosstalk == np.eye(model.grid.count)).all()
    # The response of a channel to its own cell is part of `response`: a crosstalk matrix has 1 on its diagonal.
    own = model.crosstalk / np.diag(model.crosstalk)[:, None]
    return Calibration(
        sensor=model.grid,
        frequency=frequency,
        response=channel_response(model, frequency) * np.diag(model.crosstalk).reshape(model.grid.shape),
        noise=np.full(model.grid.shape, model.noise),
        unit="V",
        crosstalk=None if alone else Crosstalk(matrix=own, uncertainty=np.zeros_like(own)),
        provenance=Provenance(source="the sensor's model", simulated=True),
    )


def cell_pressure(model: SensorModel, pressure: Array) -> Array:
    """Pressure measured by the cells, crosstalk included, shape (frame, row, column)."""
    if (model.crosstalk == np.eye(model.grid.count)).all():
        return pressure
    return (pressure.reshape(len(pressure), -1) @ model.crosstalk.T).reshape(pressure.shape)


def _respond(model: SensorModel, pressure: Array, rate: float, oversample: int) -> Array:
    frames, settle = -(-len(pressure) // oversample), settling_frames(model, rate)
    held = np.concatenate([pressure, fade_window(settle * oversample)[:, None, None] * pressure[-1]])
    length = fast_length(frames + 2 * settle)
    bins = length // 2 + 1
    # Omitting the bins above half the output rate is the ideal anti-alias filter.
    spectrum = np.fft.rfft(held, length * oversample, axis=0)[:bins] / oversample
    response = channel_response(model, np.asarray(np.fft.rfftfreq(length, 1 / rate), np.float64))
    return np.fft.irfft(spectrum * response, length, axis=0)[:frames]


def settling_frames(model: SensorModel, rate: float) -> int:
    """Frames until the slowest channel's response has decayed to 2e-9, with its delay."""
    slowest = (
        1 / (2 * np.pi * model.high_pass * model.corner.min()) + model.relaxation + model.quality / model.resonance
    )
    # exp(-20) is 2e-9, a fifth of the 1e-8 in `sense`.
    return int(np.ceil((20 * slowest + model.delay.max()) * rate)) + 1


def fade_window(length: int) -> Array:
    """Factor on the last pressure in each step after it, shape (length - 1,)."""
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.arange(1, length) / length), np.float64)


Between = Literal["steps", "lines", "waves"]
"""Model of the pressure between two points."""


def cell_weights(
    model: SensorModel, points: ControlGrid, *, centre: tuple[float, float] = (0.0, 0.0), between: Between = "steps"
) -> Array:
    """Weights that average the pressure at the points of a grid over each cell, shape (channel, point).

    The gel spreads the pressure by a Gaussian, and the cell averages over its aperture. Weights are exact integrals:
    over a grid that covers the plane the weights of each cell sum to 1. The pressure outside the grid is 0; `centre` is
    the middle (x, y) of the sensor, in m. Raises InputError if the model `between` is unknown.

    There are three models of the pressure between the points. With d the distance of a point from the middle of a cell,
    h the pitch of the points, a the aperture of the cell and s the spread of the gel, the weight of a point along one
    axis is

    - steps: box_h * box_a * gauss_s / a, constant pressure on a square around each point;
    - lines: box_h * box_h * box_a * gauss_s / (a h), linear interpolation between the points;
    - waves: interpolation band-limited below 1 / (2 h), as for a sound field: the integral of 2 h sinc(f a) exp(-2 (pi
      f s)^2) cos(2 pi f d) over 0 <= f <= 1 / (2 h).

    The squared field has no detail below half a wavelength, and less for sound from a limited cone: with points 11/3 mm
    apart, means over 8 mm of the field of four units at 20 cm are exact to .1 %.
    """
    one_of(between, _SHARES, "between")
    shares = _SHARES[between]
    along_x = shares(model, points.x + points.centre[0] - (model.grid.x + centre[0])[:, None], points.pitch)
    along_y = shares(model, points.y + points.centre[1] - (model.grid.y + centre[1])[:, None], points.pitch)
    weights = np.einsum("ry,cx->rcyx", along_y, along_x)
    return weights.reshape(model.grid.count, points.count)


def _steps(model: SensorModel, offset: Array, pitch: float) -> Array:
    """Weights along one axis for constant pressure around each point, (cell, point) like `offset`."""
    return _boxes(offset, (pitch, model.aperture), model.spread, _ramp) / model.aperture


def _lines(model: SensorModel, offset: Array, pitch: float) -> Array:
    """Weights along one axis for linear interpolation."""
    return _boxes(offset, (pitch, pitch, model.aperture), model.spread, _bow) / (model.aperture * pitch)


def _waves(model: SensorModel, offset: Array, pitch: float) -> Array:
    """Weights along one axis for band-limited interpolation."""
    top = 0.5 / pitch
    # More than pi nodes per cycle at the highest frequency and the farthest point: exact to rounding.
    nodes, weight = np.polynomial.legendre.leggauss(32 + 4 * int(np.ceil(np.abs(offset).max() / pitch)))
    frequency = top * (nodes + 1) / 2
    window = np.sinc(frequency * model.aperture) * np.exp(-2 * (np.pi * frequency * model.spread) ** 2)
    waves = np.cos(2 * np.pi * offset[..., None] * frequency)
    return np.asarray(pitch * top * (waves @ (window * weight)), np.float64)


_SHARES: Mapping[str, Callable[[SensorModel, Array, float], Array]] = MappingProxyType(
    {"steps": _steps, "lines": _lines, "waves": _waves}
)


def _boxes(offset: Array, sides: tuple[float, ...], spread: float, integral: Callable[[Array, float], Array]) -> Array:
    """A Gaussian of unit area convolved with boxes of height 1: differences of its repeated integral."""
    ends = product((0.5, -0.5), repeat=len(sides))
    parts = [np.prod(np.sign(signs)) * integral(offset + np.dot(signs, sides), spread) for signs in ends]
    return np.sum(parts, axis=0)


def _ramp(x: Array, spread: float) -> Array:
    """The Gaussian integrated twice: x Phi(x / s) + s phi(x / s)."""
    cumulated, density = _gauss(x, spread)
    return x * cumulated + spread**2 * density


def _bow(x: Array, spread: float) -> Array:
    """The Gaussian integrated three times: ((x^2 + s^2) Phi(x / s) + x s phi(x / s)) / 2."""
    cumulated, density = _gauss(x, spread)
    return ((x**2 + spread**2) * cumulated + x * spread**2 * density) / 2


_erfc = np.vectorize(math.erfc, otypes=[float])  # scipy.special takes .1 s to import


def _gauss(x: Array, spread: float) -> tuple[Array, Array]:
    """Phi(x / s), and the density phi(x / s) / s."""
    z = x / spread
    return _erfc(-z / np.sqrt(2)) / 2, np.exp(-(z**2) / 2) / (spread * np.sqrt(2 * np.pi))


def storage_precision(model: SensorModel) -> Stored:
    """Precision that holds every number of a sensor: float32 if 24 binary digits hold the steps of its converter."""
    return "f4" if model.step.as_integer_ratio()[0].bit_length() + model.bits <= 24 else "f8"
