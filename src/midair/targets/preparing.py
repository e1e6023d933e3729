"""From pressure on a few cells to the sound amplitude wanted at the control points (paper, 4.1)."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import AmplitudeFrames, ControlGrid, Medium, PressureFrames, Setting
from midair.physics import sound_amplitude
from midair.targets.interpolation import interpolation_matrix, moved_interpolation
from midair.targets.mapping import mapping_of
from midair.targets.motion import Circle
from midair.validation import positive

Array = NDArray[np.float64]

Interpolated = Literal["amplitude", "pressure"]
"""What is interpolated between the cells: sound amplitude (the paper's way), or pressure."""


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
    """Sound amplitude at each control point that is to exert the recorded pressure.

    Pressure is made positive, turned into peak sound amplitude, surrounded by one ring of zeros at the sensor's
    pitch (4 x 4 -> 6 x 6) and interpolated linearly to the control points (paper, 4.1). The centre of the sensor
    is put at the centre of the grid.

    Parameters
    ----------
    pressure : PressureFrames
        What the sensor felt.
    mapping : {"half-wave", "constant-offset", "slow-bias"}
        How signed pressure becomes pressure that only pushes, a name in `MAPPINGS`.
    grid : ControlGrid, optional
        The control points; the paper's 16 x 16 at 11/3 mm if None.
    medium : Medium, optional
        Medium of the sound; the defaults of `Medium` if None.
    interpolate : {"amplitude", "pressure"}
        "amplitude" converts first and interpolates after, as the paper does; "pressure" the other way round.
    gain : float
        Multiplies the pressure, for the correction of a beam's gain.
    circle : Circle, optional
        Moves the pattern on a slow circle over the control points; not validated on people.

    Returns
    -------
    AmplitudeFrames
        Peak, in Pa.

    Raises
    ------
    InputError
        If the mapping or the kind of interpolation is unknown, or the gain is not above zero.
    """
    to_push = mapping_of(mapping)
    if interpolate not in get_args(Interpolated):
        raise InputError(f"interpolate: expected one of {', '.join(get_args(Interpolated))}, got {interpolate!r}")
    gain = positive(gain, "gain of the pressure")
    grid, medium = grid or ControlGrid(), medium or Medium()
    # On the pressure, not on the drive: the transducers stay equally loud and the target gets stronger (eq. 6).
    pushed = gain * to_push(pressure.pressure, pressure.rate).reshape(pressure.frames, -1)
    if interpolate == "amplitude":
        amplitude = _spread(sound_amplitude(pushed, medium), pressure, grid, circle)
    else:
        amplitude = sound_amplitude(_spread(pushed, pressure, grid, circle), medium)
    settings: dict[str, Setting] = {
        "mapping": mapping,
        "interpolate": interpolate,
        "gain": gain,
        "alpha": medium.alpha,
    }
    if circle is not None:
        settings |= {"circle_m": circle.radius, "circle_hz": circle.frequency, "motion": str(circle)}
    return AmplitudeFrames(
        amplitude=amplitude,
        rate=pressure.rate,
        grid=grid,
        provenance=pressure.provenance.then("prepare", settings),
    )


def _spread(cells: Array, pressure: PressureFrames, grid: ControlGrid, circle: Circle | None) -> Array:
    """Interpolate values (frame, channel) to (frame, point)."""
    if circle is None:
        return cells @ interpolation_matrix(pressure.sensor, grid).T
    return moved_interpolation(cells, pressure.sensor, grid, circle.offset(pressure.time))
