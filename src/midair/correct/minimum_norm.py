"""Minimum-norm correction: the smallest phase change that adds the pressure that a re-recording lacked.

With Y_t = G q_t the field in the middle of frame t, q_t the output of the transducers at that time, c_t their drive,
and w the cells' weights, the pressure on the cells changes by J dtheta with

    J = 2 f w diag(conj(Y_t)) G diag(j c_t), real part,

f the radiation pressure of 1 Pa of sound. This holds for changes that are slow compared with the transducers, which is
true in the sensor's band after compensation of hold and envelope (`targets.precompensate`). The smallest phase change
that adds the pressure r is

    dtheta = J^T (J J^T + l)^-1 r,

a system of the size of the number of cells (Levenberg's step of the underdetermined problem; Nocedal & Wright,
"Numerical Optimization", 2nd edition, section 10.3). It is also the best estimate elsewhere if phase errors of the
transducers are independent. A cell with little pressure has a small slope: l is the slope of a cell with the pressure
`floor`, which limits the change.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from midair.array_types import Array, Complex
from midair.errors import ShapeError
from midair.model import ControlGrid, Drive
from midair.physics import TransducerDynamics, envelope, radiation_pressure, transfer_matrix
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class MinimumNorm:
    """Settings of the correction."""

    floor: float = 0.5
    """Pressure of a cell in Pa below which it is corrected less."""
    dynamics: TransducerDynamics = field(default_factory=TransducerDynamics)
    """Envelope dynamics of the transducers."""
    together: int = 64
    """Frames per block."""

    def __post_init__(self) -> None:
        positive(self.floor, "floor of the correction", "Pa")

    def corrected(self, drive: Drive, lacking: Array, weights: Array, grid: ControlGrid) -> Drive:
        """The drive that was played, with more pressure on the cells; silent frames do not change.

        `lacking`, shape (frame, cell), is the pressure to add, in Pa; `weights`, shape (cell, point), are those of
        `cell_weights` with between="waves" for the points of `grid`. Raises ShapeError if frames, cells or points
        differ.
        """
        if lacking.shape != (drive.frames, len(weights)) or weights.shape[1] != grid.count:
            raise ShapeError(
                f"lacking: expected ({drive.frames}, {len(weights)}) with weights of {grid.count} points, got "
                f"{lacking.shape} and {weights.shape}"
            )
        G = transfer_matrix(grid, drive.array, acoustics=drive.acoustics)
        unit = float(radiation_pressure(np.ones(1), drive.acoustics.medium)[0])
        phase, now = np.array(drive.phase), np.zeros(drive.array.count, complex)
        for first in range(0, drive.frames, self.together):
            part = slice(first, min(first + self.together, drive.frames))
            command = drive.q_of(part)
            # Two moments per frame: its middle, and its end, where the next one starts.
            radiated = envelope(command, drive.rate, 2, self.dynamics, start=now)
            now = radiated[-1]
            phase[part] += _step(lacking[part], weights, G, radiated[::2] @ G.T, command, self.floor / unit) / unit
        return replace(
            drive,
            phase=np.mod(phase, 2 * np.pi),
            provenance=drive.provenance.then("correct the drive", {"floor_pa": self.floor}),
        )


def slopes(weights: Array, G: Complex, field: Complex, command: Complex) -> Array:
    """J of each frame over the radiation pressure of 1 Pa of sound, shape (frame, cell, transducer).

    `weights` (cell, point); G (point, transducer) in Pa; `field` Y (frame, point) in Pa; `command` c (frame,
    transducer) as a fraction of full drive.
    """
    # Single precision: a step need not be exact, and the product with G dominates the time.
    turned = (weights * field.conj()[:, None, :]).astype(np.complex64)
    pulls = (turned.reshape(-1, G.shape[0]) @ G.astype(np.complex64)).reshape(*turned.shape[:2], -1)
    return np.asarray(-2 * (pulls * command[:, None, :]).imag, np.float64)


def _step(lacking: Array, weights: Array, G: Complex, field: Complex, command: Complex, floor: float) -> Array:
    """The smallest phase change of each frame, (frame, transducer), in rad times Pa of radiation over Pa^2 of sound."""
    J = slopes(weights, G, field, command)
    system = J @ J.transpose(0, 2, 1)
    pressed = (np.abs(field) ** 2 @ weights.T).sum(axis=1)
    slope = np.trace(system, axis1=1, axis2=2)
    # Without pressure the slope is 0 and no correction is possible.
    sounds = (pressed > 0) & (slope > 0)
    least = np.where(sounds, floor * slope / np.where(sounds, pressed, 1), 1)
    solved: Any = np.linalg.solve(system + least[:, None, None] * np.eye(len(weights)), lacking[..., None])
    return np.asarray((J.transpose(0, 2, 1) @ solved)[..., 0] * sounds[:, None], np.float64)
