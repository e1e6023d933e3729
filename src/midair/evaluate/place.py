"""Place of a reproduction on the palm: a rigid shift and turn in its plane, which is no distortion.

The pressure between the cells is taken as interpolated linearly, as targets are, and so that the cells would read the
original. A sensor that lies aside then reads a linear combination of the original's channels, and the shift and the
turn that explain the reproduction best are fitted with one gain. Aperture and gel are those of the usual sensor.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from midair.array_types import Array
from midair.model import ControlGrid, SensorGrid
from midair.physics import SensorModel, cell_weights

LEAST = (0.5e-3, np.radians(1.0), 0.9)
"""Shift in m or turn in rad from which a place is told, and the largest part of the residual's power that it leaves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where the pattern lies, relative to where it was recorded."""

    shift: tuple[float, float] = (0.0, 0.0)
    """(x, y) in m."""
    turn: float = 0.0
    """Counter-clockwise, in rad."""

    @property
    def distance(self) -> float:
        """Length of the shift in m."""
        return float(np.hypot(*self.shift))

    def __bool__(self) -> bool:
        return bool(self.distance or self.turn)

    def __str__(self) -> str:
        """Place in words; two points of ultrasound under 15 mm apart were felt as one in over 95 % of trials (Howard et
        al., Gap detection in pairs of ultrasound mid-air vibrotactile stimuli, 2023).
        """
        said = f"{1e3 * self.distance:.1f} mm, {abs(np.degrees(self.turn)):.0f}° off"
        return f"{said}; people feel points under 15 mm apart as one" if self.distance < 15e-3 else said


def fit_place(original: Array, reproduced: Array, sensor: SensorGrid) -> tuple[Place, Array]:
    """Fit the place of a reproduction, and return the original's reading by a sensor that lies so, same shape.

    `original` and `reproduced`, shape (frame, row, column), are in Pa, without delay. A place that is small, explains
    little or lies at the limit of the search, such as a quarter turn, is none.
    """
    frames, nowhere = len(original), Place()
    x, y = (each.reshape(frames, -1) for each in (original, reproduced))
    # Beyond 16 x 16 cells the fit would take minutes.
    if min(sensor.shape) < 2 or sensor.count > 256 or not x.any() or not y.any():
        return nowhere, original
    readings = _readings(sensor)
    apart = np.linalg.inv(readings(np.zeros(3)))
    xx, xy, yy = x.T @ x, x.T @ y, float((y**2).sum())

    def left(pose: Array) -> float:
        """Part of the reproduction's power that is not explained; the pose is in pitches and rad."""
        moved = readings(pose * (sensor.pitch, sensor.pitch, 1.0)) @ apart
        both, own = float((moved * xy.T).sum()), float(((moved @ xx) * moved).sum())
        return 1 - max(both, 0.0) ** 2 / max(own * yy, np.finfo(float).tiny)

    limits = [(-1.2, 1.2), (-1.2, 1.2), (-0.5, 0.5)]
    found = scipy.optimize.minimize(left, np.zeros(3), method="Powell", bounds=limits, options={"xtol": 1e-3})
    if (np.abs(found.x) > 0.98 * np.array(limits)[:, 1]).any():
        return nowhere, original
    pose = np.asarray(found.x) * (sensor.pitch, sensor.pitch, 1.0)
    # A sensor that lies to the left sees the pattern to the right.
    back = _turned(-pose[:2][None], -pose[2])[0]
    place = Place(shift=(float(back[0]), float(back[1])), turn=-float(pose[2]))
    if (place.distance < LEAST[0] and abs(place.turn) < LEAST[1]) or left(found.x) > LEAST[2] * left(np.zeros(3)):
        return nowhere, original
    return place, (x @ (readings(pose) @ apart).T).reshape(original.shape)


def _turned(points: Array, angle: float) -> Array:
    return points @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def _readings(sensor: SensorGrid) -> Callable[[Array], Array]:
    """Reading of each cell of a sensor at (x, y, turn) for pressure interpolated from each cell, (cell, cell)."""
    usual, steps = SensorModel.usual(sensor), 64
    line = SensorGrid(rows=1, columns=8 * steps + 1, pitch=sensor.pitch / steps)
    # The weight of a cell is a product of the same function of both distances.
    weight = cell_weights(
        SensorModel(grid=line, aperture=usual.aperture, spread=usual.spread),
        ControlGrid(rows=1, columns=1, pitch=sensor.pitch),
        between="lines",
    )[:, 0]
    own = np.sqrt(weight[4 * steps])
    cells = np.stack(np.meshgrid(sensor.x, sensor.y), axis=-1).reshape(-1, 2)

    def at(pose: Array) -> Array:
        apart = _turned(cells, float(pose[2]))[:, None] + pose[:2] - cells
        return np.asarray(np.interp(apart, line.x, weight / own).prod(axis=2), np.float64)

    return at
