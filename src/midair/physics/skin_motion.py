"""Displacement of skin moment by moment, for a pressure on a part of it that is known on a grid.

Each point's pressure counts for its square of the grid, and the tissue goes on beyond the grid for ever, without
pressure on it: no wave comes back from an edge. The surface moves by the convolution with

    h(r, omega) = 1 / (2 pi) integral of H(k, omega) J0(k r) k dk, from 0 to pi / pitch,

the finest ripple that the grid can hold; sound of wavelength lambda presses in ripples of lambda / 2 at the finest. The
integral goes above the real axis, since the waves of the tissue are poles just below it.
"""

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.errors import InputError, ShapeError
from midair.physics.skin import Tissue, skin_compliance
from midair.validation import positive

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Numbers = NDArray[Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SkinMotion:
    """The way from pressure to displacement on one grid, within a band.

    Attributes
    ----------
    response : ndarray of complex64, shape (bin, row + 1, column + 1)
        In m/Pa, of each bin of `bins`: a quarter of what the two-dimensional spectrum of a map with as many zeros
        beside it is multiplied by. The other three are its mirror images.
    rows, columns : int
        Of the grid.
    bins : slice
        Which bins of a spectrum of `length` moments there are; all others are 0.
    length : int
        Moments of the spectrum of a block.
    reach : int
        Moments for which a pressure moves the skin, after it and, for the sake of the band, before it.
    """

    response: NDArray[np.complex64]
    rows: int
    columns: int
    bins: slice
    length: int
    reach: int

    @classmethod
    def of(
        cls,
        tissue: Tissue,
        shape: tuple[int, int],
        *,
        pitch: float,
        rate: float,
        band: tuple[float, float] = (20.0, 470.0),
        edge: float = 10.0,
        settle: float = 0.25,
    ) -> "SkinMotion":
        """Work out the response.

        Parameters
        ----------
        tissue : Tissue
            What moves.
        shape : tuple of int
            Rows and columns of the grid.
        pitch : float
            Between its points, in m.
        rate : float
            Of the pressure, in Hz.
        band : tuple of float
            Frequencies that come through whole, in Hz. Steady pressure moves nothing here.
        edge : float
            Over how many Hz they fade on either side.
        settle : float
            For how long the skin is followed, in s.

        Raises
        ------
        InputError
            If there is no such band at this rate.
        """
        positive(pitch, "pitch", "m")
        if not 0 < edge < band[0] < band[1] < rate / 2:
            raise InputError(
                f"band of the skin: expected above the edge of {edge:g} Hz and below half the rate of {rate:g} Hz, "
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
        """How far the surface is pressed in, shape (frame, row, column), in m, by a pressure of that shape, in Pa."""
        return np.concatenate(list(self.parts([pressure])))

    def parts(self, pressure: Iterable[NDArray[np.floating[Any]]]) -> Iterator[Array]:
        """The same for a recording that comes in parts, in memory that does not grow with it.

        Raises
        ------
        ShapeError
            If a part is not one of this grid.
        """
        step = self.length - 2 * self.reach
        # What the blocks so far move; it begins `reach` moments before the recording.
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
        """What a block alone moves, from `reach` before it to `reach` after it, (frame + 2 reach, row, column)."""
        from scipy import fft

        rows, columns = self.rows, self.columns
        early = np.zeros((self.length, rows, columns), np.float32)
        early[self.reach : self.reach + len(block)] = block
        waves = np.zeros((self.length // 2 + 1, rows, columns), np.complex64)
        inside = fft.rfft(early, axis=0)[self.bins]
        for first in range(0, len(inside), _TOGETHER):
            some = slice(first, first + _TOGETHER)
            wide = fft.fft2(inside[some], (2 * rows, 2 * columns)) * _mirrored(self.response[some])
            waves[self.bins][some] = fft.ifft2(wide)[:, :rows, :columns]
        return fft.irfft(waves, self.length, axis=0)[: len(block) + 2 * self.reach].astype(np.float64)


_TOGETHER = 32
"""Bins whose maps are in memory at once."""

_ABOVE = 8.0
"""How far above the real axis the integral goes, in rad/m; beside it exp(8 r) stays small on any hand."""

_PANEL = 40.0
"""Width of a panel of ten nodes, in rad/m: over 12 cm, half of it would tell nothing above a part in 10 000."""


def _kernel(tissue: Tissue, shape: tuple[int, int], pitch: float, omega: Array) -> Complex:
    """H of this file's head at all distances between two points, shape (bin, row + 1, column + 1), in m/Pa/m2."""
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
    """A quarter of the two-dimensional spectra of maps that are mirror images of their first quarter."""
    from scipy.fft import dctn

    parts = [dctn(part, type=1, axes=(1, 2)) for part in (kernel.real, kernel.imag)]
    return np.asarray(parts[0] + 1j * parts[1], np.complex64)


def _mirrored(quarter: NDArray[np.complex64]) -> NDArray[np.complex64]:
    whole = np.concatenate([quarter, quarter[:, -2:0:-1]], axis=1)
    return np.concatenate([whole, whole[:, :, -2:0:-1]], axis=2)
