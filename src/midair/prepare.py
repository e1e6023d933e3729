"""From pressure on a few cells to the sound amplitude wanted at the control points (paper, 4.1)."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import AmplitudeFrames, ControlGrid, Medium, PressureFrames, SensorGrid
from midair.model.arrays import positive
from midair.physics import sound_amplitude

Array = NDArray[np.float64]

Interpolated = Literal["amplitude", "pressure"]
"""What is interpolated between the cells: sound amplitude (the paper's way), or pressure."""


def half_wave(pressure: Array) -> Array:
    """The positive part, any shape, in Pa: radiation pressure only pushes (paper, 4.1)."""
    return np.maximum(pressure, 0.0)


def constant_offset(pressure: Array) -> Array:
    """Pressure less the least that each cell ever has, shape (frame, row, column), in Pa.

    Nothing is cut, so no harmonics arise; a steady push is added, which skin feels less than vibration.
    """
    return pressure - np.minimum(pressure.min(axis=0), 0.0)


MAPPINGS: Mapping[str, Callable[[Array], Array]] = MappingProxyType(
    {"half-wave": half_wave, "constant-offset": constant_offset}
)
"""The ways from signed pressure to pressure that pushes; each takes and gives (frame, row, column) in Pa."""


def prepare(
    pressure: PressureFrames,
    *,
    mapping: str = "half-wave",
    grid: ControlGrid | None = None,
    medium: Medium | None = None,
    interpolate: Interpolated = "amplitude",
    gain: float = 1.0,
) -> AmplitudeFrames:
    """Sound amplitude at each control point that is to exert the recorded pressure.

    Pressure is made positive, turned into peak sound amplitude, surrounded by one ring of zeros at the sensor's
    pitch (4 x 4 -> 6 x 6) and interpolated linearly to the control points (paper, 4.1). The centre of the sensor
    is put at the centre of the grid.

    Parameters
    ----------
    pressure : PressureFrames
        What the sensor felt.
    mapping : {"half-wave", "constant-offset"}
        How signed pressure becomes pressure that only pushes, a name in `MAPPINGS`.
    grid : ControlGrid, optional
        The control points; the paper's 16 x 16 at 11/3 mm if None.
    medium : Medium, optional
        Of the sound; the defaults of `Medium` if None.
    interpolate : {"amplitude", "pressure"}
        "amplitude" converts first and interpolates after, as the paper does; "pressure" the other way round.
    gain : float
        Multiplies the pressure, for the correction of a beam's gain.

    Returns
    -------
    AmplitudeFrames
        Peak, in Pa.

    Raises
    ------
    InputError
        If the mapping or the kind of interpolation is unknown, or the gain is not above zero.
    """
    if mapping not in MAPPINGS:
        raise InputError(f"mapping: expected one of {', '.join(MAPPINGS)}, got {mapping!r}")
    if interpolate not in get_args(Interpolated):
        raise InputError(f"interpolate: expected one of {', '.join(get_args(Interpolated))}, got {interpolate!r}")
    gain = positive(gain, "gain of the pressure")
    grid, medium = grid or ControlGrid(), medium or Medium()
    pushed = gain * MAPPINGS[mapping](pressure.pressure).reshape(pressure.frames, -1)
    weights = interpolation_matrix(pressure.sensor, grid)
    if interpolate == "amplitude":
        amplitude = sound_amplitude(pushed, medium) @ weights.T
    else:
        amplitude = sound_amplitude(pushed @ weights.T, medium)
    return AmplitudeFrames(
        amplitude=amplitude,
        rate=pressure.rate,
        grid=grid,
        provenance=pressure.provenance.then(
            "prepare", {"mapping": mapping, "interpolate": interpolate, "gain": gain, "alpha": medium.alpha}
        ),
    )


def interpolation_matrix(sensor: SensorGrid, grid: ControlGrid) -> Array:
    """Weight of each channel at each control point, shape (point, channel): a tent of one pitch around each cell.

    Linear interpolation over rows and columns of the sensor's values with a ring of zeros around them is a
    constant matrix; points outside the ring have no weights. The centres of sensor and grid coincide, whatever
    `grid.centre` says: moving the grid moves what is played.
    """
    rows, columns = _tents(grid.y, sensor.y, sensor.pitch), _tents(grid.x, sensor.x, sensor.pitch)
    return np.einsum("ai,bj->abij", rows, columns).reshape(grid.count, sensor.count)


def _tents(points: Array, cells: Array, pitch: float) -> Array:
    """max(0, 1 - |distance| / pitch), shape (point, cell); below rounding counts as 0."""
    weight = 1 - np.abs(points[:, None] - cells) / pitch
    return np.where(weight > 1e-12, weight, 0.0)
