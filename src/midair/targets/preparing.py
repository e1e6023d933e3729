"""Convert the pressure on a few cells to target sound amplitudes at the control points (paper, 4.1)."""

from dataclasses import dataclass, replace
from typing import Literal, cast

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model import AmplitudeFrames, ControlGrid, Medium, PressureFrames, Provenance, SensorGrid, Setting
from midair.physics import SensorModel, cell_weights, sound_amplitude
from midair.streaming import LazyFrames
from midair.targets.mapping import mapping_of
from midair.validation import checked_call, one_of, positive


def interpolation_matrix(sensor: SensorGrid, grid: ControlGrid) -> Array:
    """Weight of each channel at each control point, shape (point, channel): a triangle of one pitch around each cell.

    Linear interpolation over rows and columns of the sensor's values with a ring of zeros around them is a constant
    matrix; points outside the ring have weight 0. The centres of sensor and grid coincide for any `grid.centre`: moving
    the grid moves the pattern.
    """
    rows, columns = _tents(grid.y, sensor.y, sensor.pitch), _tents(grid.x, sensor.x, sensor.pitch)
    return np.einsum("ai,bj->abij", rows, columns).reshape(grid.count, sensor.count)


def moved_interpolation(cells: Array, sensor: SensorGrid, grid: ControlGrid, offset: Array) -> Array:
    """Interpolate with the pattern displaced in each frame, shape (frame, point); parts outside the grid are lost.

    `cells`, shape (frame, channel), has any unit, and the result the same; `offset`, shape (frame, 2), is the
    displacement (x, y) in m.
    """
    rows = _tents(grid.y - offset[:, 1:], sensor.y, sensor.pitch)
    columns = _tents(grid.x - offset[:, :1], sensor.x, sensor.pitch)
    maps = np.asarray(cells, float).reshape(-1, *sensor.shape)
    moved = rows @ maps @ columns.transpose(0, 2, 1)
    return moved.reshape(len(maps), grid.count)


def _tents(points: Array, cells: Array, pitch: float) -> Array:
    """max(0, 1 - |distance| / pitch), shape (..., point, cell); values at rounding level are 0."""
    weight = 1 - np.abs(points[..., None] - cells) / pitch
    return np.where(weight > 1e-12, weight, 0.0)


def coupling(sensor: SensorModel, grid: ControlGrid) -> Array:
    """Reading of each cell for pressure interpolated from each cell, shape (cell, cell).

    Interpolation spreads a cell's pressure over a triangle of one pitch, and the sensor averages over its aperture: M =
    w T, with T the interpolation and w the cells' weights (`physics.cell_weights`).
    """
    # Like the interpolation, the weights must put the sensor at the grid's centre, wherever that is.
    weights = cell_weights(sensor, replace(grid, centre=(0.0, 0.0)), between="lines")
    return weights @ interpolation_matrix(sensor.grid, grid)


def decouple(pressure: PressureFrames, *, grid: ControlGrid | None = None) -> PressureFrames:
    """Pressure whose interpolation to the grid (by default the paper's) gives each cell its original reading.

    x' = M^-1 x, exact for interpolated pressure and approximate for interpolated amplitude. Apply it before a mapping,
    which handles the negative values that it adds. Aperture and spread are those of the usual sensor. Raises InputError
    if the condition number of M, which amplifies noise, is above 100.
    """
    grid, sensor, worst = grid or ControlGrid(), SensorModel.usual(pressure.sensor), 100.0
    matrix = coupling(sensor, grid)
    condition = float(np.linalg.cond(matrix))
    if not condition <= worst:
        raise InputError(
            f"decouple: expected control points that separate the cells, to a condition number of {worst:g}, got "
            f"{condition:.3g}; use a grid that covers the cells, or turn decouple off"
        )

    cells = pressure.pressure
    return replace(
        pressure,
        pressure=np.linalg.solve(matrix, cells.reshape(len(cells), -1).T).T.reshape(cells.shape),
        provenance=pressure.provenance.then(
            "decouple", {"spread_m": sensor.spread, "aperture_m": sensor.aperture, "condition": condition}
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """Slow circular motion of the pattern, to be felt as pressure below 20 Hz, which the sensor does not measure.

    Steady radiation pressure is hardly felt; a focus that circles a few millimetres at 5 Hz is felt as steady pressure
    (Morisaki et al., 2022 and 2023, on single foci). Here the whole pattern is moved. This has not been validated on
    people.
    """

    radius: float = 3e-3
    """In m."""
    frequency: float = 5.0
    """In Hz, below 20; at higher frequencies it is felt as vibration."""

    def __post_init__(self) -> None:
        positive(self.radius, "radius of the circle", "m")
        if positive(self.frequency, "frequency of the circle", "Hz") >= 20:
            raise InputError(f"frequency of the circle: expected below 20 Hz, got {self.frequency:g} Hz")

    def offset(self, time: Array) -> Array:
        """Displacement (x, y) of the pattern, shape (frame, 2), in m; at time 0 along x."""
        turn = 2 * np.pi * self.frequency * time
        return self.radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)

    def __str__(self) -> str:
        return f"circle of {1e3 * self.radius:g} mm at {self.frequency:g} Hz, not validated on people"


Interpolated = Literal["amplitude", "pressure"]
"""Quantity that is interpolated between the cells: sound amplitude, as in the paper, or pressure."""


@checked_call
def prepare(
    pressure: PressureFrames,
    *,
    mapping: str = "half-wave",
    grid: ControlGrid | None = None,
    medium: Medium | None = None,
    interpolate: Interpolated = "amplitude",
    gain: float = 1.0,
    circle: Circle | None = None,
    streamed: bool = False,
) -> AmplitudeFrames:
    """Target sound amplitude (peak, Pa) at each control point for a recorded pressure.

    Pressure is made positive, converted to peak sound amplitude, surrounded by one ring of zeros at the sensor's pitch
    (4 x 4 -> 6 x 6) and interpolated linearly to the control points (paper, 4.1). The centre of the sensor is placed at
    the centre of the grid. Raises InputError if the mapping or the kind of interpolation is unknown, or the gain is not
    above zero.

    Parameters
    ----------
    pressure : PressureFrames
        Calibrated pressure of the sensor's cells.
    mapping : {"half-wave", "constant-offset", "slow-bias", "receptors"}
        How signed pressure is made positive, a name in `MAPPINGS`; receptors expects a `circle` beside it.
    grid : ControlGrid, optional
        The control points; the paper's 16 x 16 at 11/3 mm if None.
    medium : Medium, optional
        The defaults of `Medium` if None.
    interpolate : {"amplitude", "pressure"}
        "amplitude" converts before interpolating, as the paper does; "pressure" after.
    gain : float
        Factor on the pressure, to correct the gain of a beam.
    circle : Circle, optional
        Moves the pattern on a slow circle; not validated on people.
    streamed : bool
        Compute the amplitudes when they are read, as lazy frames: those of all points take 8 MB a second at 4 kHz.
    """
    to_push = mapping_of(mapping, pressure.band)
    one_of(interpolate, Interpolated, "interpolate")
    gain = positive(gain, "gain of the pressure")
    grid, medium = grid or ControlGrid(), medium or Medium()
    # The gain applies to the pressure, not to the drive: amplitudes stay equal and the target gets stronger (eq. 6).
    pushes = to_push(pressure.pressure, pressure.rate)

    def wanted(block: Array, first: int) -> Array:
        pushed, places = gain * block.reshape(len(block), -1), np.arange(first, first + len(block)) / pressure.rate
        if interpolate == "amplitude":
            return _spread(sound_amplitude(pushed, medium), pressure.sensor, grid, circle, places)
        return sound_amplitude(_spread(pushed, pressure.sensor, grid, circle, places), medium)

    amplitude = (
        LazyFrames(lambda a, b: wanted(pushes[a:b], a), (pressure.frames, grid.count))
        if streamed
        else wanted(pushes, 0)
    )
    settings: dict[str, Setting] = {
        "mapping": mapping,
        "interpolate": interpolate,
        "gain": gain,
        "alpha": medium.alpha,
        "cells": pressure.sensor.shape,
        "cell_pitch_m": pressure.sensor.pitch,
    }
    if circle is not None:
        settings |= {"circle_m": circle.radius, "circle_hz": circle.frequency, "motion": str(circle)}
    return AmplitudeFrames(
        amplitude=cast("Array", amplitude),
        rate=pressure.rate,
        grid=grid,
        provenance=pressure.provenance.then("prepare", settings),
    )


def _spread(cells: Array, sensor: SensorGrid, grid: ControlGrid, circle: Circle | None, time: Array) -> Array:
    """Interpolate values (frame, channel) at times (frame,), in s, to (frame, point)."""
    if circle is None:
        return cells @ interpolation_matrix(sensor, grid).T
    return moved_interpolation(cells, sensor, grid, circle.offset(time))


def sensor_from_provenance(provenance: Provenance) -> SensorGrid:
    """The sensor cells in a drive's provenance, so that a virtual sensor can have the same; the paper's if unknown."""
    settings = provenance.last("prepare")
    shape, pitch = settings.get("cells"), settings.get("cell_pitch_m")
    if isinstance(shape, tuple) and len(shape) == 2 and isinstance(pitch, int | float):
        rows, columns = (int(length) for length in shape if isinstance(length, int | float))
        return SensorGrid(rows=rows, columns=columns, pitch=float(pitch))
    return SensorGrid()
