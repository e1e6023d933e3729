"""What a focused beam plays on each cell while it calibrates a sensor, and how much of it each cell gets."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Acoustics, ControlGrid, SensorGrid, TransducerArray
from midair.physics import SensorModel, cell_weights, focus_phase, radiation_pressure, transfer_matrix
from midair.validation import HEIGHTS, length, positive

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamPlan:
    """A pressure of many tones at several levels, one after the other; the same on each cell.

    Attributes
    ----------
    top : float
        Highest pressure of the strongest level in the middle of the focus, in Pa.
    levels : int
        Evenly spread in pressure, 5 or more.
    low, high : float
        First and last tone, in Hz: multiples of `spacing`.
    spacing : float
        Spacing of the tones up to 60 Hz, in Hz; above it they are twice as far apart. 1 / spacing is listened to.
    settle : float
        Time of each level before it is listened to, in s.
    guard : float
        Time of each level after it was listened to, in s: the beam may begin a frame early.
    rate : float
        Frames per second of the drive, in Hz; a whole multiple of `spacing`.
    """

    top: float = 100.0
    levels: int = 6
    low: float = 20.0
    high: float = 470.0
    spacing: float = 5.0
    settle: float = 0.1
    guard: float = 0.02
    rate: float = 1000.0

    def __post_init__(self) -> None:
        positive(self.top, "highest pressure", "Pa")
        positive(self.settle, "time to settle", "s")
        positive(self.guard, "guard", "s")
        if self.levels < 5:
            raise InputError(f"levels: expected 5 or more, got {self.levels}; fewer do not show a bend")
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
        """Frequencies of the tones, shape (tone,), in Hz."""
        close = np.arange(self.low, min(60.0, self.high) - self.spacing / 2, self.spacing)
        far = np.arange(max(60.0, self.low), self.high - self.spacing, 2 * self.spacing)
        return np.unique(np.concatenate([close, far, [self.high]]).round(9))

    @property
    def window(self) -> int:
        """Frames that are listened to at each level: whole periods of every tone."""
        return round(self.rate / self.spacing)

    @property
    def stretch(self) -> int:
        """Frames of each level."""
        return round(self.settle * self.rate) + self.window + round(self.guard * self.rate)

    @property
    def waveform(self) -> Array:
        """Pressure of all levels over `top`, shape (frame,), 0 to 1.

        1 + sum a cos(2 pi f_n t + phi_n), Schroeder's phases phi_n = -pi n (n - 1) / N, which keep its peaks low.
        """
        tones = self.tones
        number = np.arange(1, len(tones) + 1)
        phase = -np.pi * number * (number - 1) / len(tones)
        time = np.arange(self.stretch) / self.rate
        wave = np.cos(2 * np.pi * tones[:, None] * time + phase[:, None]).sum(axis=0)
        # Raised until nothing is below 0, since sound only pushes.
        one = (wave - wave.min()) / np.ptp(wave)
        return (np.arange(1, self.levels + 1)[:, None] / self.levels * one).ravel()


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamSetting:
    """Where the sensor lies under the array and how its cells hear, each with its standard uncertainty.

    Attributes
    ----------
    height : float
        Height of the sensor above the array, in m.
    centre : tuple of float
        (x, y) of its middle, in m.
    placement_uncertainty : float
        Uncertainty of the centre, in m.
    aperture, aperture_uncertainty : float
        Side of the square over which a cell averages, in m.
    spread, spread_uncertainty : float
        Standard deviation with which the gel spreads a point, in m.
    pressure_uncertainty : float
        Uncertainty of the array's radiation pressure, as a part of it: twice that of its sound pressure.
    dynamics_uncertainty : float
        Uncertainty of what the transducers take from each tone, as a part of it.
    """

    height: float = 0.2
    centre: tuple[float, float] = (0.0, 0.0)
    placement_uncertainty: float = 0.5e-3
    aperture: float = 8e-3
    aperture_uncertainty: float = 0.25e-3
    spread: float = 1e-3
    spread_uncertainty: float = 0.25e-3
    pressure_uncertainty: float = 0.15
    dynamics_uncertainty: float = 0.2

    def __post_init__(self) -> None:
        length(self.height, "height", HEIGHTS)


def focus_of(sensor: SensorGrid, cell: int, setting: BeamSetting) -> Array:
    """Where the beam is focused for a cell, shape (3,), in m."""
    x, y = sensor.channel_position(cell)
    return np.array([x + setting.centre[0], y + setting.centre[1], setting.height])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamField:
    """The model's pressure around a sensor for a focus of the whole array at full drive on each of its cells.

    Attributes
    ----------
    sensor : SensorGrid
        What lies there.
    points : ControlGrid
        Where the pressure is known: a twelfth of the sensor's pitch apart.
    pressure : ndarray, shape (point, cell pressed)
        In Pa.
    middle : ndarray, shape (cell pressed,)
        In the middle of each focus, in Pa.
    """

    sensor: SensorGrid
    points: ControlGrid
    pressure: Array
    middle: Array

    def on_cells(self, setting: BeamSetting, *, offset: tuple[float, float] = (0.0, 0.0)) -> Array:
        """Mean pressure on each cell, shape (cell heard, cell pressed), in Pa.

        Parameters
        ----------
        setting : BeamSetting
            Where the sensor is believed to lie, and how its cells average.
        offset : tuple of float
            (x, y) by which it lies elsewhere, in m.
        """
        model = SensorModel(grid=self.sensor, aperture=setting.aperture, spread=setting.spread)
        at = (setting.centre[0] + offset[0], setting.centre[1] + offset[1])
        return cell_weights(model, self.points, centre=at) @ self.pressure

    def changed(self, setting: BeamSetting) -> Array:
        """`on_cells` with each uncertain length changed by its standard uncertainty, shape (cause, heard, pressed)."""
        away = setting.placement_uncertainty
        wider = replace(setting, aperture=setting.aperture + setting.aperture_uncertainty)
        softer = replace(setting, spread=setting.spread + setting.spread_uncertainty)
        beside = [self.on_cells(setting, offset=offset) for offset in ((away, 0.0), (0.0, away))]
        return np.array([self.on_cells(wider), self.on_cells(softer), *beside])


def beam_field(
    array: TransducerArray,
    sensor: SensorGrid,
    setting: BeamSetting,
    *,
    acoustics: Acoustics | None = None,
) -> BeamField:
    """The field of a focus on each cell.

    Parameters
    ----------
    array : TransducerArray
        What plays.
    sensor : SensorGrid
        What lies there.
    setting : BeamSetting
        Where.
    acoustics : Acoustics, optional
        As in `transfer_matrix`.
    """
    acoustics = acoustics or Acoustics()
    around = ControlGrid(
        # A cell more on every side, since a focus on an outer cell presses beyond it.
        rows=12 * (sensor.rows + 2),
        columns=12 * (sensor.columns + 2),
        pitch=sensor.pitch / 12,
        height=setting.height,
        centre=setting.centre,
    )
    foci = np.array([focus_of(sensor, cell, setting) for cell in range(sensor.count)])
    drives = np.exp(1j * np.array([focus_phase(array, focus, acoustics=acoustics) for focus in foci])).T
    # Some hundred points at a time: the whole matrix of a fine grid would take hundreds of megabytes.
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
