"""Phases of complex drives, of silent frames, and of the field before it is solved."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.model import ControlGrid, Medium, TransducerArray
from midair.physics import wavenumber

Complex = NDArray[np.complexfloating[Any, Any]]


def unit(q: Complex) -> Complex:
    """The numbers q / |q|, of magnitude 1; 1 where q is 0."""
    size = np.abs(q)
    return np.where(size > 0, q / np.where(size > 0, size, 1), 1).astype(q.dtype)


def rippled(q: Complex) -> Complex:
    """The phases of q (transducer,) plus a ripple of .3 rad: a drive in phase with one mode would stay so."""
    return (unit(q) * np.exp(0.3j * np.sin(2.4 * np.arange(len(q))))).astype(q.dtype)


def hold(
    phase: NDArray[np.float64], audible: NDArray[np.int64], before: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Phases in which silent frames repeat the last audible frame; `before`, or zero, before the first."""
    if len(audible) == len(phase):
        return phase
    last = np.full(len(phase), -1)
    last[audible] = audible
    last = np.maximum.accumulate(last)
    return np.where(last[:, None] >= 0, phase[last], 0.0 if before is None else before)


def spreading_phase(grid: ControlGrid, array: TransducerArray, medium: Medium) -> NDArray[np.float64]:
    """Initial phases of the field in rad, shape (point,), that map the whole array onto the control grid.

    A field with constant phase is made by the few transducers below the square, a wave that diverges from behind it by
    all: with psi = k (x^2 / 2 R_x + y^2 / 2 R_y) the ray through a point at x comes from the array at x - x h / R_x,
    with the height h. R = -h w / (W - w), with the half widths w and W of grid and array, maps one onto the other; the
    sign is that of a converging wave. The phase is constant along an axis in which the array is not wider than the
    grid. `medium` gives the wavelength. See `needed_convergence` for a smaller part of this phase.
    """
    away = grid.position - array.position.mean(axis=0)
    phase = np.zeros(grid.count)
    for axis, centre in enumerate(grid.centre):
        w = float(np.abs(grid.position[:, axis] - centre).max())
        W = float(np.ptp(array.position[:, axis])) / 2
        height = float(np.abs(away[:, 2]).mean())
        if 0 < w < W and height > 0:
            radius = height * w / (W - w)
            phase -= wavenumber(array, medium) * (grid.position[:, axis] - centre) ** 2 / (2 * radius)
    return phase


def needed_convergence(amplitude: float, grid: ControlGrid, array: TransducerArray, medium: Medium) -> float:
    """Part of `spreading_phase`, .3 to 1, at which full drive reaches an amplitude in Pa on the grid, by rays.

    n transducers per area, at least the grid's, make a plane wave of p n lambda at full drive, with p in Pa m. A part c
    of the phase maps 1 + c (W / w - 1) times the grid's width onto it, along each axis, and concentrates the power.
    """
    square, whole = (np.maximum(np.ptp(each.position[:, :2], axis=0), 1e-9) for each in (grid, array))
    plane = 2 * np.pi * array.pressure * array.count / wavenumber(array, medium) / np.maximum(whole, square).prod()
    a, b = np.maximum(whole / square - 1, 1e-9)
    # The root of (1 + a c) (1 + b c) = (amplitude / plane)^2.
    root = np.sqrt((a + b) ** 2 + 4 * a * b * max((amplitude / plane) ** 2 - 1, 0.0))
    return float(np.clip((root - a - b) / (2 * a * b), 0.3, 1.0))
