"""The echo between a palm and the face of the array: sound that a rigid palm sends back, and the array again.

Kirchhoff's approximation, there and back: each surface radiates the field that falls on it, as sources of the first
Rayleigh-Sommerfeld integral, p(x) = 1 / (2 pi) sum p(y) cos (1 / R - j k) exp(j k R) / R dS, with R the distance from y
to x and cos that of its angle to the surface's normal (Goodman, Introduction to Fourier Optics, 3.4). Further echoes
are neglected.
"""

from typing import Any

import numpy as np

from midair.array_types import Array, Complex
from midair.model import Acoustics, Palm, TransducerArray
from midair.physics.playback import Waves
from midair.physics.propagation import Precision, transfer_matrix, wavenumber

_ACROSS = 0.6
"""Distance in wavelengths between the points of the array's face; waves at 50 degrees need .65."""

_AT_ONCE = 2**14
"""Elements of a matrix that are computed at once, in the cache."""

_PITCH = 5e-3
"""Distance between the points of a palm in m, .58 wavelengths; 2 mm change the echo by .006 of the direct sound."""


def palm_matrix(
    points: Array,
    array: TransducerArray,
    *,
    reflection: complex,
    middle: Array,
    acoustics: Acoustics | None = None,
    precision: Precision = "double",
) -> Complex:
    """`transfer_matrix` with the echo of a round palm parallel to z = 0, complex, in Pa, shape (point, transducer).

    `points` (point, 3) and the `middle` (3,) of the palm, which is 85 mm wide, are in m; `reflection` is the factor of
    the array's face.
    """
    direct = transfer_matrix(points, array, acoustics=acoustics, precision=precision)
    return direct + reflection * palm_echo(points, array, middle=middle, acoustics=acoustics) if reflection else direct


def palm_echo(
    points: Array, array: TransducerArray, *, middle: Array, diameter: float = 85e-3, acoustics: Acoustics | None = None
) -> Complex:
    """The echo of a rigid face of the array, `echo_matrix`, for a round palm of this `diameter` in m."""
    skin, area = Palm.disc(diameter, pitch=_PITCH).points(middle), _PITCH**2 * np.array([0.0, 0.0, 1.0])
    return echo_matrix(points, skin, array, area=area, acoustics=acoustics)


def mean_reflection(reflection: complex, height_uncertainty: float, k: float) -> complex:
    """Reflection factor whose echo is the mean over heights with this standard uncertainty in m; k in rad/m.

    The path there and back changes by twice the height: exp(j 2 k z) has the mean exp(-2 (k sigma)^2). Below .02 of
    the echo it is 0.
    """
    share = float(np.exp(-2 * (k * height_uncertainty) ** 2))
    return reflection * share if share > 0.02 else 0.0


def echo_matrix(
    points: Array, skin: Array, array: TransducerArray, *, area: Array, acoustics: Acoustics | None = None
) -> Complex:
    """The echo at points on a palm from a rigid face of the array, complex, in Pa, shape (point, transducer).

    Times the reflection factor of the face, which is between 0 and 1 with some phase, it adds to `transfer_matrix`.

    `points` (point, 3) and `skin` (skin point, 3), a flat palm that reflects with factor 1, are in m; `area` (3,) is
    the area of a skin point in m² along the palm's normal. Skin points are at most .6 wavelengths apart. The face is
    the smallest rectangle around the transducers, in their plane.
    """
    acoustics = acoustics or Acoustics()
    k = wavenumber(array, acoustics.medium)
    face, patch = _face(array, 2 * np.pi / k)
    back, there = _radiated(face, skin, k, area), _radiated(points, face, k, patch)
    arriving: Any = transfer_matrix(skin, array, acoustics=acoustics, precision="single")
    return (there @ back) @ arriving


def _face(array: TransducerArray, wavelength: float) -> tuple[Array, Array]:
    """Points of the array's face (point, 3), and the area of each along the normal (3,)."""
    middle = array.position.mean(axis=0)
    _, _, axes = np.linalg.svd(array.position - middle, full_matrices=False)
    plane, turns = (array.position - middle) @ axes[:2].T, np.radians(np.arange(90))
    extents = np.ptp(np.tensordot(plane, _turned(turns), axes=(1, 0)), axis=0).prod(axis=0)
    turned = _turned(turns[int(np.argmin(extents))])
    # Half a transducer more than the outermost positions.
    low, high = (plane @ turned).min(axis=0) - wavelength / 2, (plane @ turned).max(axis=0) + wavelength / 2
    counts = np.ceil((high - low) / (_ACROSS * wavelength)).astype(int)
    sides = (high - low) / counts
    x, y = np.meshgrid(*[low[axis] + (np.arange(counts[axis]) + 0.5) * sides[axis] for axis in (0, 1)])
    flat = np.stack([x.ravel(), y.ravel()], axis=1) @ turned.T
    return middle + flat @ axes[:2], np.prod(sides) * axes[2]


def _turned(angle: Array) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _radiated(to: Array, sources: Array, k: float, area: Array) -> Waves:
    """Field at points (point, 3) of sources (source, 3) of magnitude 1 on a surface, each of this area (3,)."""
    # Products of coordinates instead of differences: single precision keeps the phase within 1e-4 rad.
    places = np.column_stack([to, (to**2).sum(axis=1), np.ones(len(to))]).astype(np.float32)
    origins = np.column_stack([-2 * sources, np.ones(len(sources)), (sources**2).sum(axis=1)]).astype(np.float32).T
    heights, ground = ((each @ area / (2 * np.pi)).astype(np.float32) for each in (to, sources))
    field, step = np.empty((len(to), len(sources)), np.complex64), max(_AT_ONCE // len(sources), 1)
    for first in range(0, len(to), step):
        part = slice(first, first + step)
        wave, distance = field[part], np.sqrt(places[part] @ origins)
        turn, factor = np.float32(k) * distance, np.abs(heights[part, None] - ground)
        factor /= distance * distance
        cos, sin, near = np.cos(turn), np.sin(turn), factor / distance
        factor *= np.float32(k)
        wave.real = near * cos + factor * sin
        wave.imag = near * sin - factor * cos
    return field
