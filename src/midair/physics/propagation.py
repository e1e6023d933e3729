"""The sound field of the array: p = G q (paper, 2.2)."""

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.model import Acoustics, ControlGrid, Drive, Medium, TransducerArray
from midair.physics.directivity import off_axis

Complex = NDArray[np.complex128]
Points = ControlGrid | NDArray[np.float64]


def wavenumber(array: TransducerArray, medium: Medium) -> float:
    """Wave number k = 2 pi f / c, in rad/m."""
    return 2 * np.pi * array.frequency / medium.speed


def transfer_matrix(points: Points, array: TransducerArray, *, acoustics: Acoustics | None = None) -> Complex:
    """Sound pressure (peak, Pa) at each point for each transducer at full drive and phase 0, paper eq. (3).

    G_mn = C D(theta_mn) exp(-beta r_mn) exp(j k r_mn) / r_mn, with C the pressure of one transducer at 1 m. Complex,
    shape (point, transducer).

    Parameters
    ----------
    points : ControlGrid or ndarray, shape (point, 3)
        Positions in m.
    acoustics : Acoustics, optional
        Speed and attenuation of the air, and D; the paper's if None.

    Raises
    ------
    InputError
        If a point lies on a transducer.
    """
    acoustics = acoustics or Acoustics()
    places = _places(points)
    matrix = np.empty((len(places), array.count), np.complex128)
    # Slices that fit into the cache, since intermediate arrays are ten times as large; the result does not change.
    step = max(_AT_ONCE // array.count, 1)
    for first in range(0, len(places), step):
        matrix[first : first + step] = _rows(places[first : first + step], array, acoustics)
    return matrix if array.alike else matrix * array.response


_AT_ONCE = 2**16
"""Elements of a transfer matrix that are computed at once."""


def _rows(places: NDArray[np.float64], array: TransducerArray, acoustics: Acoustics) -> Complex:
    """The transfer matrix at some points."""
    away = places[:, None, :] - array.position[None, :, :]
    distance = np.sqrt(np.einsum("mnx,mnx->mn", away, away))
    if distance.min() <= 0:
        raise InputError("points: expected none on a transducer, got distance 0; move the grid away from the array")
    k = wavenumber(array, acoustics.medium)
    # On the axis, rounding can give a cosine above 1.
    cosine = np.clip(np.einsum("mnx,nx->mn", away, array.normal) / distance, -1, 1)
    radiated = array.pressure * off_axis(np.arccos(cosine), acoustics.directivity, wavenumber=k)
    return radiated * np.exp((1j * k - acoustics.medium.attenuation) * distance) / distance


def propagate(drive: Drive, points: Points, *, acoustics: Acoustics | None = None) -> Complex:
    """The steady-state field of each frame of a drive, p = G q, paper eq. (1); complex, peak, in Pa, (frame, point).

    Parameters
    ----------
    points : ControlGrid or ndarray, shape (point, 3)
        Positions in m.
    acoustics : Acoustics, optional
        If None, those that the drive was solved for.
    """
    return drive.q @ transfer_matrix(points, drive.array, acoustics=acoustics or drive.acoustics).T


def focus_phase(
    array: TransducerArray, point: NDArray[np.float64], *, acoustics: Acoustics | None = None
) -> NDArray[np.float64]:
    """Phases that focus all transducers on one point, shape (transducer,), in rad.

    theta_n = -k r_n, minus the measured phase of the transducer's response.
    """
    distance = np.linalg.norm(np.asarray(point, float) - array.position, axis=1)
    late = wavenumber(array, (acoustics or Acoustics()).medium) * distance + np.angle(array.response)
    return np.mod(-late, 2 * np.pi)


def focus_amplitude(points: Points, array: TransducerArray, *, acoustics: Acoustics | None = None) -> float:
    """Peak sound pressure of the strongest single focus of the whole array at full drive, in Pa.

    The largest row sum of ``|G|`` over the points. `strength` is the peak of a target over this.
    """
    matrix = transfer_matrix(points, array, acoustics=acoustics)
    return float(np.abs(matrix).sum(axis=1).max())


def quantise_phase(phase: NDArray[np.float64], *, bits: int = 8) -> NDArray[np.float64]:
    """Phases rounded to 2 pi / 2^bits, 0 to 2 pi, as firmware stores them, same shape, in rad."""
    steps = 2**bits
    # Round before the modulo: the last half step rounds up to a whole turn, which is step 0.
    return np.mod(np.rint(phase / (2 * np.pi) * steps), steps) * (2 * np.pi / steps)


def _places(points: Points) -> NDArray[np.float64]:
    places = points.position if isinstance(points, ControlGrid) else np.asarray(points, float)
    if places.ndim != 2 or places.shape[1] != 3:
        raise ShapeError(f"points: expected shape (point, 3), got {places.shape}")
    return places
