"""Targets of the benchmarks: binary patterns, and sequences of frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from midair.datasets import stroke
from midair.model import Acoustics, ControlGrid, Medium, SensorGrid, TransducerArray
from midair.physics import transfer_matrix
from midair.solvers import Problem
from midair.solvers.phases import spreading_phase
from midair.targets import interpolation_matrix, prepare

TEN = (0x0001, 0x8001, 0x0660, 0xF99F, 0x5A5A, 0x1248, 0xFFFF, 0x00FF, 0x8421, 0x3C18)
GRID, ARRAY, AIR = ControlGrid(), TransducerArray.autd3(), Medium(attenuation=0)


def patterns(others: int, seed: int = 2024) -> list[int]:
    """The ten patterns of the yardstick and random others; bit k is channel k."""
    drawn = np.random.default_rng(seed).choice(np.arange(1, 65536), others, replace=False)
    return [*TEN, *(int(bits) for bits in drawn)]


def problem_of(channels: np.ndarray, strength: float) -> Problem:
    """Point sources in air without loss, the paper's array and grid; `strength` is amplitude 1 over the focus."""
    G = transfer_matrix(GRID, ARRAY, acoustics=Acoustics(medium=AIR, directivity="point"))
    weights = interpolation_matrix(SensorGrid(), GRID)
    return Problem(
        G=G / np.abs(G).sum(axis=1).max(),
        amplitude=strength * np.asarray(channels, float) @ weights.T,
        psi=spreading_phase(GRID, ARRAY, AIR),
    )


def binary(bits: list[int]) -> np.ndarray:
    """Patterns as channel amplitudes, (pattern, 16)."""
    return np.array([[(one >> k) & 1 for k in range(16)] for one in bits], float)


def moving_blob(frames: int, rate: float = 1000.0) -> np.ndarray:
    """A Gaussian of 11 mm that oscillates at up to .25 m/s, with 100 Hz modulation from .1 to 1: (frame, 16)."""
    time = np.arange(frames) / rate
    x = -0.011 * np.cos(0.25 / 0.011 * time)
    return _gaussian(x, 0.3 * x, 0.011) * (0.55 + 0.45 * np.sin(2 * np.pi * 100 * time + 0.3))[:, None]


def beating_blob(frames: int, rate: float = 1000.0) -> np.ndarray:
    """The same with half-wave rectified pressure, so that half of the frames are silent."""
    time = np.arange(frames) / rate
    x = -0.011 * np.cos(0.25 / 0.011 * time)
    return _gaussian(x, 0.3 * x, 0.011) * np.sqrt(np.maximum(np.sin(2 * np.pi * 100 * time + 0.3), 0))[:, None]


def towel(frames: int, strength: float) -> Problem:
    """The synthetic towel stroke with the paper's mapping from pressure to sound, with its peak at a strength.

    Frames below a hundredth of the peak amplitude (a ten-thousandth of its pressure) are omitted: they are
    imperceptible, and their large relative errors would hide the others.
    """
    amplitude = prepare(stroke("towel"), grid=GRID, medium=AIR).amplitude
    amplitude = amplitude[amplitude.max(axis=1) > 0.01 * amplitude.max()][:frames]
    return replace(problem_of(np.zeros((1, 16)), strength), amplitude=strength * amplitude / amplitude.max())


def _gaussian(x: np.ndarray, y: np.ndarray, width: float) -> np.ndarray:
    sensor = SensorGrid()
    X, Y = np.meshgrid(sensor.x, sensor.y)
    square = (X - x[:, None, None]) ** 2 + (Y - y[:, None, None]) ** 2
    return np.exp(-square / (2 * width**2)).reshape(len(x), 16)
