"""Directivity of a transducer: D(theta) of the paper's eq. (3)."""

from typing import get_args

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.model import Directivity

Array = NDArray[np.float64]


def off_axis(angle: Array, kind: Directivity, *, wavenumber: float, radius: float = 4.5e-3) -> Array:
    """Amplitude relative to the axis, 1 on the axis.

    Parameters
    ----------
    angle : ndarray, any shape
        Angle between the transducer's normal and the point, in rad, 0 to pi.
    kind : {"point", "piston", "t4010a1"}
        "point": 1 everywhere. "piston": 2 J1(x) / x, x = k a sin(theta), a circular piston in a baffle. "t4010a1":
        the measured table of AUTD3's transducer.
    wavenumber : float
        k in rad/m, used by the piston.
    radius : float
        a of the piston, in m.

    Raises
    ------
    InputError
        If `kind` is unknown.
    """
    angle = np.asarray(angle, float)
    if kind == "point":
        return np.ones_like(angle)
    if kind == "piston":
        return _piston(wavenumber * radius * np.sin(angle))
    if kind == "t4010a1":
        return _t4010a1(np.degrees(angle))
    raise InputError(f"directivity: expected one of {', '.join(get_args(Directivity))}, got {kind!r}")


def _piston(x: Array) -> Array:
    """2 J1(x) / x; Kinsler et al., Fundamentals of Acoustics, 7.4."""
    from scipy.special import j1

    # On the axis the quotient is 0 / 0; its limit is 1.
    small = np.abs(x) < 1e-8
    return np.where(small, 1.0, 2 * j1(x) / np.where(small, 1.0, x))


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
    a, b, c, d = table[piece].transpose(-1, *range(piece.ndim))
    return a + x * (b + x * (c + x * d))
