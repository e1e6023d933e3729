"""Motion of skin under pressure on its surface: waves in a viscoelastic half space, or in a layer bonded to bone.

A pressure p exp(j (omega t - k x)) moves the surface inwards by u = H(k, omega) p. With mu = mu0 + j omega eta
(Kelvin-Voigt solid), k_T^2 = rho omega^2 / mu, k_L^2 = k_T^2 (1 - 2 nu) / (2 (1 - nu)), a^2 = k^2 - k_L^2 and b^2 = k^2
- k_T^2, potentials phi = A exp(-a z) + B exp(a (z - h)) and psi = C exp(-b z) + D exp(b (z - h)) give displacement and
traction (Graff, Wave Motion in Elastic Solids, 1975, section 6.1; Lamb's problem). In a half space B and D are 0, and

    H = k_T^2 a / (mu [4 k^2 a b - (2 k^2 - k_T^2)^2]),

with the static limit 1 / (2 mu k) for nu = 1/2. In a layer both displacements vanish at z = h.

The model is not validated on people: skin is neither flat nor homogeneous, and no parameter was measured on a palm
under ultrasound.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError, ShapeError
from midair.model import BAND
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchChannel:
    """Detection threshold of a tactile channel: a plateau of highest sensitivity with slopes on both sides."""

    best: tuple[float, float]
    """Lowest and highest frequency of the plateau, in Hz."""
    below: float
    """Rise of the threshold below the plateau, in dB per octave."""
    above: float
    """Rise of the threshold above the plateau, in dB per octave."""
    just_felt: float
    """Peak displacement at the threshold of half of all people on the plateau, in m."""
    summed: float
    """Area in m2 over which the channel sums the power of the displacement, and to which `just_felt` refers; 0 if the
    displacement of one place decides."""
    averaged: float
    """Duration in s over which the channel averages this power."""

    def weight(self, frequency: Array) -> Array:
        """Factor on a displacement, 1 on the plateau, same shape as `frequency` (Hz); 0 at 0 Hz."""
        f = np.asarray(frequency, float)
        with np.errstate(divide="ignore"):
            under, over = np.log2(np.maximum(self.best[0] / f, 1)), np.log2(np.maximum(f / self.best[1], 1))
        return 10 ** (-(self.below * under + self.above * over) / 20)


TOUCH_CHANNELS: dict[Literal["NP I", "P"], TouchChannel] = {
    "NP I": TouchChannel(best=(10.0, 800.0), below=12.0, above=12.0, just_felt=3.9e-6, summed=0.0, averaged=0.05),
    "P": TouchChannel(best=(250.0, 250.0), below=12.0, above=9.0, just_felt=0.1e-6, summed=2.9e-4, averaged=0.2),
}
"""Tactile channels of the thenar eminence by their names in psychophysics.

Verrillo (J. Acoust. Soc. Am. 35(12), 1963; as described by Gescheider and Verrillo, doi 10.1007/978-1-4613-3039-4_10,
and by Forta, Griffin and Morioka, Somatosens. Mot. Res. 29(1), 2012): with a contact of 2.9 cm2 the threshold is flat
up to 40 Hz and falls by 12 dB an octave to its lowest value at about 250 Hz. From 80 to 320 Hz it falls by 3 dB for
each doubling of the area from .02 to 2.9 cm2, that is, by the power summed over it; at 25 and 40 Hz the area has no
effect. P are the Pacinian corpuscles; NP I is flat at the value that P has at 40 Hz, 3.9 um. Thresholds of high
frequencies fall with duration, those of low ones do not (Gescheider, Sens. Process. 1(1), 1976). Assumed: .1 um, since
no figure for the palm in um could be read; that NP I is flat above 40 Hz, and its slopes beyond; .2 s for the Pacinian
channel, and for NP I a period of 20 Hz. None of this was measured on people with this array."""


Numbers = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tissue:
    """Material below the skin surface."""

    stiffness: float = 15e3
    """mu0, static shear modulus in Pa: a third of the elastic modulus."""
    viscosity: float = 5.0
    """eta in Pa s."""
    density: float = 1060.0
    """rho in kg/m3."""
    poisson: float = 0.5
    """nu, Poisson's ratio; 1/2 is incompressible."""
    depth: float | None = None
    """h, depth of rigid bone in m; None for a half space."""

    def __post_init__(self) -> None:
        positive(self.stiffness, "stiffness of the tissue", "Pa")
        positive(self.density, "density of the tissue", "kg/m3")
        if self.depth is not None:
            positive(self.depth, "depth of the tissue", "m")
        if not 0 <= self.viscosity < np.inf or not 0 <= self.poisson <= 0.5:
            raise InputError(
                "tissue: expected a viscosity of 0 Pa s or more and Poisson's ratio from 0 to 0.5, got "
                f"{self.viscosity:g} Pa s and {self.poisson:g}"
            )


SKINS: Mapping[str, Tissue] = MappingProxyType(
    {
        "soft, deep": Tissue(stiffness=10e3, viscosity=3.2),
        "soft, on bone": Tissue(stiffness=10e3, viscosity=3.2, depth=10e-3),
        "stiff, deep": Tissue(stiffness=50e3, viscosity=5.0),
        "stiff, on bone": Tissue(stiffness=50e3, viscosity=5.0, depth=10e-3),
    }
)
"""A range that probably includes real skin.

Soft: surface waves at 2.9 m/s, as on pigs' skin (3 m/s; Kirkpatrick et al. 2004), elastic modulus 30 kPa (forearms: 14
to 25 kPa by ultrasound), viscosity of the same forearms, 3.2 Pa s. Stiff: surface waves at 6.6 m/s, faster with
frequency, as on fingers (up to 7 m/s; Manfredi et al. 2012). Assumed: viscosity 5 Pa s of the stiff skin, 10 mm to the
bone in both layers, and incompressibility."""


def skin_compliance(tissue: Tissue, k: Numbers, omega: Numbers) -> Complex:
    """H(k, omega): inward displacement of the surface over the pressure on it, complex, in m/Pa.

    `k` is the wavenumber along the surface, in rad/m, float or complex with an imaginary part of 0 or more. `omega`,
    which broadcasts with it, is the angular frequency, above 0, in rad/s; in layers rounding errors dominate below a
    thousandth of k c_T, with c_T the speed of shear waves.
    """
    k, mu = np.asarray(k, np.complex128), tissue.stiffness + 1j * np.asarray(omega, float) * tissue.viscosity
    kt2 = tissue.density * np.asarray(omega, float) ** 2 / mu
    a = _decaying(k**2 - kt2 * (1 - 2 * tissue.poisson) / (2 * (1 - tissue.poisson)))
    b = _decaying(k**2 - kt2)
    if tissue.depth is None:
        return np.asarray(kt2 * a / (mu * (4 * k**2 * a * b - (2 * k**2 - kt2) ** 2)), np.complex128)
    return _layer(k, a, b, kt2, tissue.depth) / mu


def _layer(k: Complex, a: Complex, b: Complex, kt2: Complex, depth: float) -> Complex:
    """H times mu of a layer: zero displacement at the bone eliminates B and D, which leaves A and C."""
    ea, eb, jk, s = np.exp(-a * depth), np.exp(-b * depth), 1j * k, 2 * k**2 - kt2
    # At the bone j k (A ea + B) + b (C eb - D) = 0 and a (B - A ea) + j k (C eb + D) = 0.
    d = a * b - k**2
    b_a, b_c = (a * b + k**2) * ea / d, -2 * jk * b * eb / d
    d_a, d_c = 2 * jk * a * ea / d, (a * b + k**2) * eb / d
    # Shear traction 0 and normal traction -p at the top.
    shear_a, shear_c = -2 * jk * a * (1 - ea * b_a) - s * eb * d_a, 2 * jk * a * ea * b_c - s * (1 + eb * d_c)
    press_a, press_c = s * (1 + ea * b_a) + 2 * jk * b * eb * d_a, s * ea * b_c - 2 * jk * b * (1 - eb * d_c)
    # A = -shear_c and C = shear_a, except for a common factor.
    inward = -shear_c * (-a * (1 - ea * b_a) + jk * eb * d_a) + shear_a * (a * ea * b_c + jk * (1 + eb * d_c))
    return np.asarray(-inward / (-shear_c * press_a + shear_a * press_c), np.complex128)


def _decaying(square: Complex) -> Complex:
    root = np.sqrt(square)
    return np.asarray(np.where(np.real(root) < 0, -root, root), np.complex128)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SkinMotion:
    """Linear operator from pressure to displacement on one grid, within a band.

    Each point's pressure acts on its square of the grid; the tissue continues beyond the grid without pressure on it,
    so no wave returns from an edge. The surface moves by the convolution with

        h(r, omega) = 1 / (2 pi) integral of H(k, omega) J0(k r) k dk, from 0 to pi / pitch,

    the highest wavenumber of the grid; sound of wavelength lambda has radiation pressure ripples of at least lambda /
    2. The path of integration runs above the real axis, since the poles of the surface waves are just below it.
    """

    response: NDArray[np.complex64]
    """In m/Pa, shape (bin, row + 1, column + 1): the first quadrant of the factor on the two-dimensional spectrum of a
    zero-padded map; the others are its mirror images."""
    rows: int
    columns: int
    bins: slice
    """The bins of a spectrum of `length` moments that are not 0."""
    length: int
    """Number of moments in the spectrum of a block."""
    reach: int
    """Number of moments for which a pressure moves the skin, after it and, because of the band limit, before it."""

    @classmethod
    def of(
        cls,
        tissue: Tissue,
        shape: tuple[int, int],
        *,
        pitch: float,
        rate: float,
        band: tuple[float, float] = BAND,
        edge: float = 10.0,
        settle: float = 0.25,
    ) -> "SkinMotion":
        """Compute the response on a grid of `shape` (row, column) and `pitch` in m.

        `rate` is that of the pressure, `band` the passband, without static pressure, and `edge` the width of the
        transition on either side of it, all in Hz; `settle` is the length of the impulse response, in s. Raises
        InputError if the band with its transitions does not fit below half the rate.
        """
        positive(pitch, "pitch", "m")
        if not 0 < edge < band[0] < band[1] < rate / 2:
            raise InputError(
                f"band of the skin: expected above edge, {edge:g} Hz, and below half the rate of {rate:g} Hz, "
                f"got {band[0]:g} to {band[1]:g} Hz"
            )
        reach = int(np.ceil(settle * rate))
        frequency = np.arange(2 * reach + 1) * rate / (4 * reach)
        through = np.flatnonzero((frequency > band[0] - edge) & (frequency < band[1] + edge))
        beyond = np.maximum(np.maximum(band[0] - frequency, frequency - band[1])[through], 0)
        kernel = _kernel(tissue, shape, pitch, 2 * np.pi * frequency[through])
        return cls(
            response=_even_spectrum(kernel * (pitch * np.cos(np.pi / 2 * beyond / edge)[:, None, None]) ** 2),
            rows=shape[0],
            columns=shape[1],
            bins=slice(int(through[0]), int(through[-1]) + 1),
            length=4 * reach,
            reach=reach,
        )

    def displacement(self, pressure: NDArray[np.floating[Any]]) -> Array:
        """Inward displacement of the surface in m, shape (frame, row, column), for a pressure of that shape in Pa.

        Raises ShapeError for another grid.
        """
        if pressure.ndim != 3 or pressure.shape[1:] != (self.rows, self.columns):
            raise ShapeError(f"pressure: expected shape (frame, {self.rows}, {self.columns}), got {pressure.shape}")
        step, whole = self.length - 2 * self.reach, np.zeros((len(pressure) + 2 * self.reach, self.rows, self.columns))
        # Each block also moves the skin `reach` moments before and after it.
        for first in range(0, len(pressure), step):
            moved = self._moved(pressure[first : first + step])
            whole[first : first + len(moved)] += moved
        return whole[self.reach : self.reach + len(pressure)]

    def _moved(self, block: NDArray[np.floating[Any]]) -> Array:
        """Displacement by one block alone, with `reach` moments before and after it, (frame + 2 reach, row, column)."""
        rows, columns = self.rows, self.columns
        early = np.zeros((self.length, rows, columns), np.float32)
        early[self.reach : self.reach + len(block)] = block
        waves = np.zeros((self.length // 2 + 1, rows, columns), np.complex64)
        inside = scipy.fft.rfft(early, axis=0)[self.bins]
        for first in range(0, len(inside), _TOGETHER):
            some = slice(first, first + _TOGETHER)
            whole = np.pad(self.response[some], ((0, 0), (0, rows - 1), (0, columns - 1)), mode="reflect")
            wide = scipy.fft.fft2(inside[some], (2 * rows, 2 * columns)) * whole
            waves[self.bins][some] = scipy.fft.ifft2(wide)[:, :rows, :columns]
        return scipy.fft.irfft(waves, self.length, axis=0)[: len(block) + 2 * self.reach].astype(np.float64)


_TOGETHER = 32
"""Bins whose maps are in memory at once."""

_ABOVE = 8.0
"""Distance of the integration path above the real axis, in rad/m; exp(8 r) stays small on any hand."""

_PANEL = 40.0
"""Width of a panel of ten nodes, in rad/m: over 12 cm, half of it changes the result by less than 1e-4."""


def _kernel(tissue: Tissue, shape: tuple[int, int], pitch: float, omega: Array) -> Complex:
    """The kernel h at all distances between two points, shape (bin, row + 1, column + 1), in m/Pa/m2."""
    place, k, waves = _waves(shape, pitch)
    return np.asarray((waves @ skin_compliance(tissue, k[:, None], omega)).T[:, place], np.complex128)


@lru_cache(maxsize=2)
def _waves(shape: tuple[int, int], pitch: float) -> tuple[NDArray[np.intp], Complex, Complex]:
    """The integral on one grid, for tissues one after the other.

    Index of each point's distance, shape (row + 1, column + 1); wavenumbers (node,) in rad/m; weights (distance, node).
    """
    row, column = np.arange(shape[0] + 1), np.arange(shape[1] + 1)
    square, place = np.unique(row[:, None] ** 2 + column**2, return_inverse=True)
    k, weight = _path(np.pi / pitch)
    waves = scipy.special.jv(0, pitch * np.sqrt(square)[:, None] * k) * (weight * k / (2 * np.pi))
    return place.reshape(len(row), len(column)), k, np.asarray(waves, np.complex128)


def _path(finest: float) -> tuple[Complex, Complex]:
    """Nodes and weights of the integral from 0 to `finest`, above the real axis, shape (node,) each, in rad/m."""
    corners = [0, _ABOVE * (2 + 1j), finest + 1j * _ABOVE, finest]
    node, weight = np.polynomial.legendre.leggauss(10)
    nodes, weights = list[Numbers](), list[Numbers]()
    for start, end in itertools.pairwise(corners):
        edges = np.linspace(start, end, int(np.ceil(abs(end - start) / _PANEL)) + 1)
        half = np.diff(edges)[:, None] / 2
        nodes.append((edges[:-1, None] + half * (1 + node)).ravel())
        weights.append((half * weight).ravel())
    return np.asarray(np.concatenate(nodes), np.complex128), np.asarray(np.concatenate(weights), np.complex128)


def _even_spectrum(kernel: Complex) -> NDArray[np.complex64]:
    """First quadrants of the two-dimensional spectra of symmetric maps, given by their first quadrants."""
    parts = [scipy.fft.dctn(part, type=1, axes=(1, 2)) for part in (kernel.real, kernel.imag)]
    return np.asarray(parts[0] + 1j * parts[1], np.complex64)
