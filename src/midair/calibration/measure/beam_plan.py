"""Plan of a focused beam that calibrates a sensor cell by cell, and the pressure that each cell gets."""

from dataclasses import dataclass, replace

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model import BAND, HEIGHT, HEIGHTS, RATE, Acoustics, ControlGrid, SensorGrid, TransducerArray
from midair.physics import SensorModel, cell_weights, focus_phase, radiation_pressure, transfer_matrix
from midair.validation import length, positive


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
        if self.levels < 5:
            raise InputError(f"levels: expected 5 or more, got {self.levels}; fewer cannot show a nonlinearity")
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
