"""Convert the pressure on a few cells to target sound amplitudes at the control points (paper, 4.1)."""

from dataclasses import dataclass
from types import NoneType
from typing import Literal, cast, get_args

import numpy as np

from midair.array_types import Array
from midair.errors import InputError
from midair.model import AmplitudeFrames, ControlGrid, Medium, PressureFrames, Provenance, SensorGrid, Setting
from midair.physics import sound_amplitude
from midair.streaming import LazyFrames
from midair.targets.decoupling import interpolation_matrix, moved_interpolation
from midair.targets.mapping import mapping_of
from midair.validation import check_type, positive


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


def prepare(
    pressure: PressureFrames,
    *,
    mapping: str = "half-wave",
    grid: ControlGrid | None = None,
    medium: Medium | None = None,
    interpolate: Interpolated = "amplitude",
    gain: float = 1.0,
    circle: Circle | None = None,
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
    mapping : {"half-wave", "constant-offset", "slow-bias"}
        How signed pressure is made positive, a name in `MAPPINGS`.
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
    """
    check_type(pressure, "pressure", PressureFrames)
    check_type(grid, "grid", ControlGrid, NoneType)
    to_push = mapping_of(mapping, pressure.band)
    if interpolate not in get_args(Interpolated):
        raise InputError(f"interpolate: expected one of {', '.join(get_args(Interpolated))}, got {interpolate!r}")
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
        LazyFrames(lambda a, b: wanted(pushes.read(a, b), a), (pressure.frames, grid.count))
        if isinstance(pushes, LazyFrames)
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
    for step in reversed(provenance.steps):
        shape, pitch = step.settings.get("cells"), step.settings.get("cell_pitch_m")
        if step.stage == "prepare" and isinstance(shape, tuple) and len(shape) == 2 and isinstance(pitch, int | float):
            rows, columns = (int(length) for length in shape if isinstance(length, int | float))
            return SensorGrid(rows=rows, columns=columns, pitch=float(pitch))
    return SensorGrid()
