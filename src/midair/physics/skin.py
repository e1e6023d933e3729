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

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class TouchChannel:
    """Frequency weighting of skin displacement with a plateau of highest sensitivity and slopes on both sides."""

    best: tuple[float, float]
    """Lowest and highest frequency of the plateau, in Hz."""
    below: float
    """Slope below the plateau, in dB per octave."""
    above: float
    """Slope above the plateau, in dB per octave."""

    def weight(self, frequency: Array) -> Array:
        """Factor on a displacement, 1 on the plateau, same shape as `frequency` (Hz); 0 at 0 Hz."""
        f = np.asarray(frequency, float)
        with np.errstate(divide="ignore"):
            under, over = np.log2(np.maximum(self.best[0] / f, 1)), np.log2(np.maximum(f / self.best[1], 1))
        return 10 ** (-(self.below * under + self.above * over) / 20)


TOUCH_CHANNELS: dict[Literal["NP I", "P"], TouchChannel] = {
    "NP I": TouchChannel(best=(10.0, 40.0), below=12.0, above=12.0),
    "P": TouchChannel(best=(250.0, 250.0), below=12.0, above=9.0),
}
"""Tactile channels by their names in psychophysics.

Pacinian corpuscles (P) respond from 40 to 800 Hz, best at about 250 Hz; the channel NP I determines thresholds from 10
to 40 Hz (Forta, Griffin and Morioka, Somatosens. Mot. Res. 29(1), 2012, a review). The slopes of P are Verrillo's (J.
Acoust. Soc. Am. 35(12), 1963). Assumed: NP I is flat from 10 to 40 Hz, and has the low-frequency slope of P on both
sides. None of this was measured on people with this array."""


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
    """The root that decays with depth."""
    root = np.sqrt(square)
    return np.asarray(np.where(np.real(root) < 0, -root, root), np.complex128)
