"""How skin moves under a pressure on its surface: waves in a viscoelastic half space, or in a layer bonded to bone.

A pressure p exp(j (omega t - k x)) moves the surface inwards by u = H(k, omega) p. With mu = mu0 + j omega eta (Kelvin
and Voigt's solid), k_T^2 = rho omega^2 / mu, k_L^2 = k_T^2 (1 - 2 nu) / (2 (1 - nu)), a^2 = k^2 - k_L^2 and
b^2 = k^2 - k_T^2, potentials phi = A exp(-a z) + B exp(a (z - h)) and psi = C exp(-b z) + D exp(b (z - h)) give
displacement and traction (Graff, Wave Motion in Elastic Solids, 1975, section 6.1; Lamb's problem). In a half space B
and D are 0, and

    H = k_T^2 a / (mu [4 k^2 a b - (2 k^2 - k_T^2)^2]),

1 / (2 mu k) of slow changes where nu is 1/2. In a layer both displacements vanish at z = h.

Nothing here is a claim about people: skin is neither flat nor even, and no figure was measured on a palm under sound.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError
from midair.validation import positive

Numbers = NDArray[Any]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tissue:
    """What lies below the surface.

    Attributes
    ----------
    stiffness : float
        mu0, shear modulus of slow changes, in Pa: a third of the elastic modulus.
    viscosity : float
        eta, in Pa s.
    density : float
        rho, in kg/m3.
    poisson : float
        nu; 1/2 is a tissue that keeps its volume.
    depth : float or None
        h, down to rigid bone, in m; None for a half space.
    """

    stiffness: float = 15e3
    viscosity: float = 5.0
    density: float = 1060.0
    poisson: float = 0.5
    depth: float | None = None

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
"""A range that real skin probably lies in.

Soft: surface waves at 2.9 m/s, as on pigs' skin (3 m/s; Kirkpatrick et al. 2004), elastic modulus 30 kPa (forearms: 14
to 25 kPa by ultrasound), viscosity of the same forearms, 3.2 Pa s. Stiff: surface waves at 6.6 m/s and faster with
frequency, as on fingers (up to 7 m/s; Manfredi et al. 2012). Assumed: the stiff one's viscosity of 5 Pa s, the 10 mm
down to bone of both layers, and that volume stays.
"""


def skin_compliance(tissue: Tissue, k: Numbers, omega: Numbers) -> Complex:
    """H(k, omega): inward displacement of the surface over the pressure on it.

    Parameters
    ----------
    tissue : Tissue
        What moves.
    k : ndarray of float or complex
        Wavenumber along the surface, in rad/m; a complex one with an imaginary part of 0 or more.
    omega : ndarray, broadcasts with `k`
        Angular frequency, above 0, in rad/s. Statics are the limit; below a thousandth of k c_T, with c_T the speed of
        shear waves, rounding takes over in layers.

    Returns
    -------
    ndarray of complex
        In m/Pa.
    """
    k, mu = np.asarray(k, np.complex128), tissue.stiffness + 1j * np.asarray(omega, float) * tissue.viscosity
    kt2 = tissue.density * np.asarray(omega, float) ** 2 / mu
    a = _decaying(k**2 - kt2 * (1 - 2 * tissue.poisson) / (2 * (1 - tissue.poisson)))
    b = _decaying(k**2 - kt2)
    if tissue.depth is None:
        return np.asarray(kt2 * a / (mu * (4 * k**2 * a * b - (2 * k**2 - kt2) ** 2)), np.complex128)
    return _layer(k, a, b, kt2, tissue.depth) / mu


def _layer(k: Complex, a: Complex, b: Complex, kt2: Complex, depth: float) -> Complex:
    """Mu H of a layer: two unknowns are left when no displacement at the bone has told B and D by A and C."""
    ea, eb, jk, s = np.exp(-a * depth), np.exp(-b * depth), 1j * k, 2 * k**2 - kt2
    # At the bone j k (A ea + B) + b (C eb - D) = 0 and a (B - A ea) + j k (C eb + D) = 0.
    d = a * b - k**2
    b_a, b_c = (a * b + k**2) * ea / d, -2 * jk * b * eb / d
    d_a, d_c = 2 * jk * a * ea / d, (a * b + k**2) * eb / d
    # Shear traction 0 and normal traction -p at the top.
    shear_a, shear_c = -2 * jk * a * (1 - ea * b_a) - s * eb * d_a, 2 * jk * a * ea * b_c - s * (1 + eb * d_c)
    press_a, press_c = s * (1 + ea * b_a) + 2 * jk * b * eb * d_a, s * ea * b_c - 2 * jk * b * (1 - eb * d_c)
    # A = -shear_c and C = shear_a, but for a common factor.
    inward = -shear_c * (-a * (1 - ea * b_a) + jk * eb * d_a) + shear_a * (a * ea * b_c + jk * (1 + eb * d_c))
    return np.asarray(-inward / (-shear_c * press_a + shear_a * press_c), np.complex128)


def _decaying(square: Complex) -> Complex:
    """The root that dies away with depth."""
    root = np.sqrt(square)
    return np.asarray(np.where(np.real(root) < 0, -root, root), np.complex128)
