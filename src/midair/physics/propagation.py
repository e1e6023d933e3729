"""The sound field of the array, p = G q (paper, 2.2), its radiation pressure (2.1, 4.1), and its error E (5.1)."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from midair.array_types import Array, Complex
from midair.errors import InputError, NegativePressureError, ShapeError
from midair.model import Acoustics, ControlGrid, Directivity, Drive, Medium, TransducerArray
from midair.validation import checked_call, frozen_array


def off_axis(angle: Array, kind: Directivity, *, wavenumber: float, radius: float = 4.5e-3) -> Array:
    """Amplitude relative to the axis, 1 on the axis, at angles from the transducer's normal in rad, 0 to pi.

    "point" is 1 everywhere, "piston" 2 J1(x) / x with x = k a sin(theta), a circular piston in a baffle, and "t4010a1"
    the measured table of AUTD3's transducer. k is `wavenumber` in rad/m, and a the `radius` of the piston in m. Raises
    InputError if `kind` is unknown.
    """
    angle = np.asarray(angle)
    if kind == "point":
        return np.ones_like(angle, np.float64)
    if kind == "piston":
        from scipy.special import j1

        x = wavenumber * radius * np.sin(angle)
        # Kinsler et al., Fundamentals of Acoustics, 7.4. On the axis the quotient is 0 / 0; its limit is 1.
        small = np.abs(x) < 1e-8
        return np.where(small, 1.0, 2 * j1(x) / np.where(small, 1.0, x))
    if kind == "t4010a1":
        return _t4010a1(np.degrees(angle))
    raise InputError(f"directivity: expected one of {', '.join(get_args(Directivity))}, got {kind!r}")


def _t4010a1(degrees: Array) -> Array:
    """The table of the AUTD3 SDK: cubic pieces of 10 degrees, 0 to 90. Angles above 90 are mirrored."""
    # Each row: coefficients of one piece, constant term first.
    table = np.array(
        [
            (1, 0, 0, 0),
            (1, 0, 0, 0),
            (1, -0.00459648054721, -7.87968093807e-4, 1.60125528528e-5),
            (0.891250938, -0.0155520765675, -3.07591508224e-4, 2.9747624976e-6),
            (0.707945784, -0.0208114779827, -2.18348633296e-4, 2.31910931569e-5),
            (0.501187234, -0.0182211227016, 4.7738416141e-4, -1.1901034125e-5),
            (0.354813389, -0.0122437497109, 1.20353137658e-4, 6.77743734332e-6),
            (0.251188643, -0.00780345575475, 3.23676257958e-4, -5.99548024824e-6),
            (0.199526231, -0.00312857467007, 1.43850511e-4, -4.79372835035e-6),
        ]
    )
    front = np.where(degrees > 90, 180 - degrees, degrees)
    # A multiple of 10 degrees belongs to the piece below it, as in the SDK.
    piece = np.clip(np.ceil(front / 10).astype(int) - 1, 0, 8)
    x = front - 10 * piece
    a, b, c, d = (each.take(piece) for each in table.T.astype(front.dtype))
    return a + x * (b + x * (c + x * d))


Points = ControlGrid | Array


def wavenumber(array: TransducerArray, medium: Medium) -> float:
    """Wave number k = 2 pi f / c, in rad/m."""
    return 2 * np.pi * array.frequency / medium.speed


Precision = Literal["single", "double"]


def transfer_matrix(
    points: Points, array: TransducerArray, *, acoustics: Acoustics | None = None, precision: Precision = "double"
) -> Complex:
    """Sound pressure (peak, Pa) at each point for each transducer at full drive and phase 0, paper eq. (3).

    G_mn = C D(theta_mn) exp(-beta r_mn) exp(j k r_mn) / r_mn, with C the pressure of one transducer at 1 m. Complex,
    shape (point, transducer). Raises InputError if a point lies on a transducer.

    Positions, shape (point, 3), are in m. `acoustics` gives speed and attenuation of the air, and D; the paper's if
    None. In "single" precision, a fifth of the time, phases are exact to 1e-4 rad.
    """
    acoustics = acoustics or Acoustics()
    real, kind = (np.float32, np.complex64) if precision == "single" else (np.float64, np.complex128)
    places, position, normal = (each.astype(real) for each in (_places(points), array.position, array.normal.T))
    matrix: Any = np.empty((len(places), array.count), kind)
    # Slices that fit into the cache, since intermediate arrays are ten times as large; the result does not change.
    step = max(_AT_ONCE // array.count, 1)
    k = wavenumber(array, acoustics.medium)
    for first in range(0, len(places), step):
        # Component by component, which takes half the time of an axis of three.
        x, y, z = (places[first : first + step, axis, None] - position[:, axis] for axis in range(3))
        distance = np.sqrt(x * x + y * y + z * z)
        if distance.min() <= 0:
            raise InputError("points: expected none on a transducer, got distance 0; move the grid away from the array")
        # On the axis, rounding can give a cosine above 1.
        angle = np.arccos(np.clip((x * normal[0] + y * normal[1] + z * normal[2]) / distance, -1, 1))
        radiated = array.pressure * off_axis(angle, acoustics.directivity, wavenumber=k)
        radiated *= np.exp(-acoustics.medium.attenuation * distance) / distance
        turn, field = k * distance, matrix[first : first + step]
        field.real, field.imag = radiated * np.cos(turn), radiated * np.sin(turn)
    return matrix if array.alike else matrix * array.response.astype(kind)


_AT_ONCE = 2**16
"""Elements of a transfer matrix that are computed at once."""


@checked_call
def propagate(drive: Drive, points: Points, *, acoustics: Acoustics | None = None) -> Complex:
    """Compute the steady-state field of each frame of a drive, p = G q, paper eq. (1): peak, in Pa, (frame, point).

    Parameters
    ----------
    points : ControlGrid or ndarray
        Positions, shape (point, 3), in m.
    acoustics : Acoustics, optional
        Those that the drive was solved for if None.
    """
    return drive.q @ transfer_matrix(points, drive.array, acoustics=acoustics or drive.acoustics).T


def focus_phase(array: TransducerArray, point: Array, *, acoustics: Acoustics | None = None) -> Array:
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


def quantise_phase(phase: Array, *, bits: int = 8) -> Array:
    """Phases rounded to 2 pi / 2^bits, 0 to 2 pi, as firmware stores them, same shape, in rad."""
    steps = 2**bits
    # Round before the modulo: the last half step rounds up to a whole turn, which is step 0.
    return np.mod(np.rint(phase / (2 * np.pi) * steps), steps) * (2 * np.pi / steps)


def _places(points: Points) -> Array:
    axes = ("point" if not isinstance(points, np.ndarray) or len(points) else 0, 3)
    return points.position if isinstance(points, ControlGrid) else frozen_array(points, "points", axes)


Field = Complex | Array


def relative_error(field: Field, amplitude: Array) -> Array:
    """The paper's error of each frame, shape (frame,): ``E = || |G q| - p || / || p ||``.

    `field`, G q or its magnitude, and `amplitude`, the target p, are peak values in Pa, shape (frame, point). At the
    best phases u of the target, ``|| G q - diag(p) u || = || |G q| - p ||``, so this is the residual of eq. (5) over
    the target's norm. 0 where target and field are both silent; infinite where only the target is.
    """
    if np.shape(field) != np.shape(amplitude):
        raise ShapeError(f"field: expected the target's shape {np.shape(amplitude)}, got {np.shape(field)}")
    missed = np.linalg.norm(np.abs(field) - amplitude, axis=-1)
    wanted = np.linalg.norm(amplitude, axis=-1)
    unwanted = np.where(missed > 0, np.inf, 0.0)
    return np.divide(missed, wanted, out=unwanted, where=wanted > 0)


def printed_error(field: Field, amplitude: Array) -> Array:
    """The error as the paper prints it, (1/M) sqrt(||G q - p||^2 / ||p||^2), with M the number of points.

    The factor 1/M must be a misprint: with M = 256 an error of 10 % would be .04 %, and the paper reports 5 to 15 %.
    Use `relative_error`; this function exists so that both can be quoted.
    """
    return relative_error(field, amplitude) / np.shape(amplitude)[-1]


def sound_amplitude(pressure: Array, medium: Medium) -> Array:
    """Peak amplitude in Pa of a plane wave whose radiation pressure on a surface is `pressure`.

    p_amp = c sqrt(2 rho P / alpha), section 4.1, with alpha = 1 + R, R the power reflection coefficient; 100 Pa of
    radiation pressure need 3801 Pa of sound. A pressure below zero raises NegativePressureError.
    """
    pressure = np.asarray(pressure, float)
    if pressure.size and pressure.min() < 0:
        raise NegativePressureError(
            f"radiation pressure cannot be negative, got {pressure.min():g} Pa; choose a mapping in prepare()"
        )
    return medium.speed * np.sqrt(2 * medium.density * pressure / medium.alpha)


def radiation_pressure(amplitude: Array | Complex, medium: Medium) -> Array:
    """Radiation pressure in Pa of a plane wave of peak `amplitude` (Pa, complex or magnitude) on a surface.

    P = alpha p0^2 / (rho c^2) with p0 = amplitude / sqrt(2) the rms sound pressure, section 2.1.
    """
    return medium.alpha * np.abs(amplitude) ** 2 / (2 * medium.density * medium.speed**2)


@dataclass(frozen=True, slots=True, eq=False)
class ArrayKey:
    """Hashable key of an array that compares its numbers, for caches: each drive file creates its own array object."""

    array: TransducerArray

    @property
    def numbers(self) -> tuple[object, ...]:
        """All values that determine the sound field."""
        one = self.array
        return one.position.tobytes(), one.normal.tobytes(), one.pressure, one.frequency, one.response.tobytes()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ArrayKey) and self.numbers == other.numbers

    def __hash__(self) -> int:
        return hash(self.numbers)
