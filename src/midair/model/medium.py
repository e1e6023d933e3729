"""The air that sound goes through and the surface that it pushes."""

from dataclasses import dataclass

from midair.errors import InputError
from midair.validation import positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Medium:
    """Air, and how much of the sound the surface in it reflects (paper, 2.1).

    Attributes
    ----------
    density : float
        rho, in kg/m3.
    speed : float
        Speed of sound c, in m/s.
    attenuation : float
        Amplitude attenuation beta, in Np/m (ISO 9613-1: .15 at 40 kHz, 20-25 °C, 40-60 % humidity).
    alpha : float
        1 + R, with R the power reflection coefficient of the surface: 1 to 2.
    """

    density: float = 1.25
    speed: float = 340.0
    attenuation: float = 0.15
    alpha: float = 2.0

    def __post_init__(self) -> None:
        positive(self.density, "density", "kg/m3")
        positive(self.speed, "speed", "m/s")
        if not 0 <= self.attenuation < float("inf"):
            raise InputError(f"attenuation: expected 0 Np/m or more, got {self.attenuation:g}")
        if not 1 <= self.alpha <= 2:
            raise InputError(f"alpha: expected 1 to 2 (1 + power reflection coefficient), got {self.alpha:g}")
