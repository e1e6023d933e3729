"""Minimum-norm correction: the least change of the phases that presses what a re-recording lacked.

With Y_t = G q_t the field in the middle of frame t, q_t what the transducers radiate by then, c_t what they are told,
and w the cells' weights, the pressure on the cells changes by J dtheta with

    J = 2 f w diag(conj(Y_t)) G diag(j c_t), real part,

f the radiation pressure of 1 Pa of sound: for changes that are slow against the transducers, as all in the sensor's
band are once what lacked is made up for hold and envelope (`targets.precompensate`). Of all changes that press r the
least is

    dtheta = J^T (J J^T + l)^-1 r,

a system as small as there are cells (Levenberg's step of the underdetermined problem; Nocedal & Wright, "Numerical
Optimization", 2nd edition, section 10.3). It is also the best guess of what is wrong everywhere else if each
transducer's phase is off by itself. A cell that is nearly silent has no slope: l is the slope of one that presses
`floor`, so that no cell is asked for more than it can give.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import ShapeError
from midair.model import ControlGrid, Drive
from midair.physics import TransducerDynamics, envelope, radiation_pressure, transfer_matrix
from midair.validation import positive

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class MinimumNorm:
    """How the step is made.

    Attributes
    ----------
    floor : float
        Pressure of a cell, in Pa, below which it is corrected less.
    dynamics : TransducerDynamics
        How the transducers follow their drive.
    together : int
        Frames at once.
    """

    floor: float = 0.5
    dynamics: TransducerDynamics = field(default_factory=TransducerDynamics)
    together: int = 64

    def __post_init__(self) -> None:
        positive(self.floor, "floor of the correction", "Pa")

    def corrected(self, drive: Drive, lacking: Array, weights: Array, grid: ControlGrid) -> Drive:
        """The drive whose frames press on the cells by so much more.

        Frames that are silent stay as they are.

        Parameters
        ----------
        drive : Drive
            What was played.
        lacking : ndarray, shape (frame, cell)
            What is to press in addition, in Pa.
        weights : ndarray, shape (cell, point)
            Of the cells, from `cell_weights` between waves.
        grid : ControlGrid
            The points of the weights.

        Raises
        ------
        ShapeError
            If what lacks or the weights are not of these frames, cells and points.
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
            told = _told(drive, part)
            # Two moments a frame: its middle, and its end, from which the next one goes on.
            radiated = envelope(told, drive.rate, 2, self.dynamics, start=now)
            now = radiated[-1]
            phase[part] += _step(lacking[part], weights, G, radiated[::2] @ G.T, told, self.floor / unit) / unit
        return replace(
            drive,
            phase=np.mod(phase, 2 * np.pi),
            provenance=drive.provenance.then("correct the drive", {"floor_pa": self.floor}),
        )


def slopes(weights: Array, G: Complex, field: Complex, told: Complex) -> Array:
    """J of each frame over the radiation pressure of 1 Pa of sound, shape (frame, cell, transducer).

    Parameters
    ----------
    weights : ndarray, shape (cell, point)
        Of the cells.
    G : ndarray of complex, shape (point, transducer)
        Field of each transducer at full drive, in Pa.
    field : ndarray of complex, shape (frame, point)
        Y, in Pa.
    told : ndarray of complex, shape (frame, transducer)
        c, what the transducers are told, as a part of full drive.
    """
    # Single precision: a step need not be exact, and the product with G is all of the work.
    turned = (weights * field.conj()[:, None, :]).astype(np.complex64)
    pulls = (turned.reshape(-1, G.shape[0]) @ G.astype(np.complex64)).reshape(*turned.shape[:2], -1)
    return np.asarray(-2 * (pulls * told[:, None, :]).imag, np.float64)


def _step(lacking: Array, weights: Array, G: Complex, field: Complex, told: Complex, floor: float) -> Array:
    """The least change of phase of each frame, (frame, transducer), in rad times Pa of radiation over Pa^2 of sound."""
    J = slopes(weights, G, field, told)
    system = J @ J.transpose(0, 2, 1)
    pressed = (np.abs(field) ** 2 @ weights.T).sum(axis=1)
    slope = np.trace(system, axis1=1, axis2=2)
    # Where nothing presses there is no slope, and nothing to correct.
    sounds = (pressed > 0) & (slope > 0)
    least = np.where(sounds, floor * slope / np.where(sounds, pressed, 1), 1)
    solved: Any = np.linalg.solve(system + least[:, None, None] * np.eye(len(weights)), lacking[..., None])
    return np.asarray((J.transpose(0, 2, 1) @ solved)[..., 0] * sounds[:, None], np.float64)


def _told(drive: Drive, part: slice) -> Complex:
    level = np.asarray(drive.level)[part].reshape(part.stop - part.start, -1)
    return np.asarray(level * np.exp(1j * np.asarray(drive.phase)[part]), np.complex128)
