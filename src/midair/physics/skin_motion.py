"""Displacement of skin over time, for a pressure on a grid.

Each point's pressure acts on its square of the grid; the tissue continues beyond the grid without pressure on it, so no
wave returns from an edge. The surface moves by the convolution with

    h(r, omega) = 1 / (2 pi) integral of H(k, omega) J0(k r) k dk, from 0 to pi / pitch,

the highest wavenumber of the grid; sound of wavelength lambda has radiation pressure ripples of at least lambda / 2.
The path of integration runs above the real axis, since the poles of the surface waves are just below it.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array, Complex
from midair.errors import InputError, ShapeError
from midair.model import BAND
from midair.physics.skin import Tissue, skin_compliance
from midair.validation import positive

Numbers = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SkinMotion:
    """Linear operator from pressure to displacement on one grid, within a band."""

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
        """Inward displacement of the surface in m, shape (frame, row, column), for a pressure of that shape in Pa."""
        return np.concatenate(list(self.parts([pressure])))

    def parts(self, pressure: Iterable[NDArray[np.floating[Any]]]) -> Iterator[Array]:
        """Yield the displacement for a recording in parts, with constant memory. Raises ShapeError for another grid."""
        step = self.length - 2 * self.reach
        # Overlap of the previous blocks; it begins `reach` moments before the recording.
        held, early = np.zeros((2 * self.reach, self.rows, self.columns)), self.reach
        for block in self._blocks(pressure, step):
            moved = self._moved(block)
            moved[: len(held)] += held
            done, held = moved[: len(block)], moved[len(block) :]
            yield done[early:]
            early = max(early - len(block), 0)
        yield held[early : self.reach]

    def _blocks(self, pressure: Iterable[NDArray[np.floating[Any]]], step: int) -> Iterator[NDArray[np.floating[Any]]]:
        for part in pressure:
            if part.ndim != 3 or part.shape[1:] != (self.rows, self.columns):
                raise ShapeError(f"pressure: expected shape (frame, {self.rows}, {self.columns}), got {part.shape}")
            for first in range(0, len(part), step):
                yield part[first : first + step]

    def _moved(self, block: NDArray[np.floating[Any]]) -> Array:
        """Displacement by one block alone, with `reach` moments before and after it, (frame + 2 reach, row, column)."""
        from scipy import fft

        rows, columns = self.rows, self.columns
        early = np.zeros((self.length, rows, columns), np.float32)
        early[self.reach : self.reach + len(block)] = block
        waves = np.zeros((self.length // 2 + 1, rows, columns), np.complex64)
        inside = fft.rfft(early, axis=0)[self.bins]
        for first in range(0, len(inside), _TOGETHER):
            some = slice(first, first + _TOGETHER)
            whole = np.pad(self.response[some], ((0, 0), (0, rows - 1), (0, columns - 1)), mode="reflect")
            wide = fft.fft2(inside[some], (2 * rows, 2 * columns)) * whole
            waves[self.bins][some] = fft.ifft2(wide)[:, :rows, :columns]
        return fft.irfft(waves, self.length, axis=0)[: len(block) + 2 * self.reach].astype(np.float64)


_TOGETHER = 32
"""Bins whose maps are in memory at once."""

_ABOVE = 8.0
"""Distance of the integration path above the real axis, in rad/m; exp(8 r) stays small on any hand."""

_PANEL = 40.0
"""Width of a panel of ten nodes, in rad/m: over 12 cm, half of it changes the result by less than 1e-4."""


def _kernel(tissue: Tissue, shape: tuple[int, int], pitch: float, omega: Array) -> Complex:
    """The kernel h at all distances between two points, shape (bin, row + 1, column + 1), in m/Pa/m2."""
    from scipy.special import jv

    row, column = np.arange(shape[0] + 1), np.arange(shape[1] + 1)
    square, place = np.unique(row[:, None] ** 2 + column**2, return_inverse=True)
    k, weight = _path(np.pi / pitch)
    moved = skin_compliance(tissue, k[:, None], omega) * (weight * k / (2 * np.pi))[:, None]
    h = jv(0, pitch * np.sqrt(square)[:, None] * k) @ moved
    return np.asarray(h.T[:, place.ravel()].reshape(-1, len(row), len(column)), np.complex128)


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
    from scipy.fft import dctn

    parts = [dctn(part, type=1, axes=(1, 2)) for part in (kernel.real, kernel.imag)]
    return np.asarray(parts[0] + 1j * parts[1], np.complex64)
