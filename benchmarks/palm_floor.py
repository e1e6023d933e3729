"""Lowest power in the band outside the square that was found for any phases: `benchmarks.palm --part floor`.

The target is a short periodic signal: cells with random pressure between 31 and 469 Hz, at 1 kHz. The cost is the error
of a palm's pressure over all frames and only within the band, ``||B (P - W)||^2 + lambda ||B P||^2`` over the square
and over the palm of 85 mm around it. Steady pressure is free everywhere, so neither the mapping nor a constant leak
matters. The starts are the solutions of `fast` and `glide` with a quiet palm, random constant phases, and random phases
for each frame; L-BFGS (SciPy) then optimises all phases at once. Fields are steady states of each frame.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from midair.model import AmplitudeFrames, ControlGrid, Palm, SensorGrid, TransducerArray
from midair.physics import focus_amplitude, transfer_matrix
from midair.solvers import solve
from midair.targets import interpolation_matrix

Array = NDArray[np.float64]

GRID, SENSOR, RATE = ControlGrid(height=0.2), SensorGrid(), 1000.0
SIDES = {4: (2, 2), 16: (4, 4)}


@dataclass(frozen=True, kw_only=True)
class Piece:
    """A periodic target, and the cost of phases for it."""

    G: NDArray[np.complex64]
    """Over the strongest focus, shape (listener, transducer): control points, then the palm outside the square."""
    wanted: Array
    """Pressure over that of the strongest focus, with the bias, shape (frame, point)."""
    share: Array
    """Area of each listener over that of a control point."""

    @classmethod
    def of(cls, array: TransducerArray, strength: float, frames: int) -> Piece:
        rng, time = np.random.default_rng(5), np.arange(frames) / frames
        turns = np.arange(1, frames // 2)[:, None]
        wave = np.cos(2 * np.pi * (turns * time)[..., None] + rng.uniform(0, 2 * np.pi, (len(turns), 1, SENSOR.count)))
        cells = wave.sum(axis=0)
        push = (cells - cells.min(axis=0)) @ interpolation_matrix(SENSOR, GRID).T
        palm = Palm.disc(pitch=4.25e-3)
        beyond = palm.grid(GRID.height).position[palm.beyond(27.5e-3, 27.5e-3).ravel()]
        G = np.concatenate([transfer_matrix(points, array) for points in (GRID.position, beyond)])
        share = np.repeat([1.0, (palm.pitch / GRID.pitch) ** 2], [GRID.count, len(beyond)])
        focus = focus_amplitude(GRID, array)
        return cls(G=(G / focus).astype(np.complex64), wanted=strength**2 * push / push.max(), share=share)

    @property
    def swing(self) -> Array:
        """Target in the band, shape (frame, listener)."""
        return self.in_band(np.pad(self.wanted, ((0, 0), (0, len(self.G) - self.wanted.shape[1]))))

    @property
    def bounded(self) -> Piece:
        """The same with two halves of each transducer, which together have any amplitude up to full drive."""
        return replace(self, G=np.concatenate([self.G, self.G], axis=1) / 2)

    def in_band(self, pressure: Array) -> Array:
        """Remove the steady part and the highest frequency of the frames."""
        spectrum = np.fft.rfft(pressure, axis=0)
        spectrum[0] = spectrum[-1] = 0
        return np.fft.irfft(spectrum, len(pressure), axis=0)

    def pressure(self, theta: Array) -> tuple[NDArray[np.complex64], NDArray[np.complex64], Array]:
        """Drive, field and its squared magnitude for phases (frame, transducer); fields are (frame, listener)."""
        q = np.exp(1j * theta.astype(np.float32))
        y = q @ self.G.T
        return q, y, (y.real**2 + y.imag**2).astype(float)

    def cost(self, weight: float) -> Any:
        """Cost function with gradient for SciPy."""
        swing, points = self.swing, self.wanted.shape[1]
        counts = self.share * np.where(np.arange(len(self.G)) < points, 1.0, weight)
        unit = (swing**2).sum()

        def function(x: Array) -> tuple[float, Array]:
            q, y, pressure = self.pressure(x.reshape(len(self.wanted), -1))
            left = self.in_band(pressure) - swing
            slope = (2 / unit * counts * left).astype(np.float32) * y
            back = q.conj() * (slope @ self.G.conj())
            return float((counts * left**2).sum() / (2 * unit)), back.imag.ravel().astype(float)

        return function

    def figures(self, theta: Array) -> tuple[float, float, float]:
        """Share of the power outside, and signal to distortion in the square and over the palm, in dB."""
        points, swing, made = self.wanted.shape[1], self.swing, self.in_band(self.pressure(theta)[2])
        power = self.share * (made**2).sum(axis=0)
        if not power.any():
            return float("nan"), float("nan"), float("nan")
        return (
            float(power[points:].sum() / power.sum()),
            _ratio(swing[:, :points], made[:, :points], self.share[:points]),
            _ratio(swing, made, self.share),
        )


def _ratio(wanted: Array, made: Array, share: Array) -> float:
    power = float((share * wanted**2).sum())
    gain = float((share * wanted * made).sum()) / power
    return float(10 * np.log10(gain**2 * power / (share * (made - gain * wanted) ** 2).sum()))


def starts(piece: Piece, array: TransducerArray, count: int) -> Iterator[tuple[str, Array]]:
    """Solutions of solvers, and random phases."""
    focus = focus_amplitude(GRID, array)
    target = AmplitudeFrames(amplitude=focus * np.sqrt(piece.wanted), rate=RATE, grid=GRID)
    for method in ("fast", "glide"):
        yield method, solve(target, array, method=method, quiet_palm=0.1).drive.phase
    rng = np.random.default_rng(0)
    for number in range(count):
        still = number % 2 == 0
        theta = rng.uniform(0, 2 * np.pi, (1 if still else len(piece.wanted), array.count))
        yield "at random, still" if still else "at random", np.tile(theta, (len(piece.wanted) if still else 1, 1))


def floor(
    units: Sequence[int],
    strengths: Sequence[float],
    *,
    starts_at_random: int,
    frames: int,
    most: int,
    bounded: bool = False,
) -> None:
    """Print the result of each start."""
    print(f"{frames} frames at 1 kHz, {most} iterations; outside, in the square, over the palm")
    print("| units | strength | start | as solved | lambda 1 | lambda 10 | CPU s |\n" + "| --- " * 7 + "|")
    for count in units:
        array = TransducerArray.autd3(columns=SIDES[count][0], rows=SIDES[count][1])
        for strength in strengths:
            piece = Piece.of(array, strength, frames)
            for name, theta in starts(piece, array, starts_at_random):
                began = time.process_time()
                said = " | ".join(descended(*((piece.bounded, halved(theta)) if bounded else (piece, theta)), most))
                print(f"| {count} | {strength:g} | {name} | {said} | {time.process_time() - began:.0f} |", flush=True)


def halved(theta: Array) -> Array:
    """Phases of two halves of each transducer, with a small difference, because equal halves would stay equal."""
    return np.concatenate([theta - 0.3, theta + 0.3], axis=1)


def descended(piece: Piece, theta: Array, most: int) -> Iterator[str]:
    """Figures of a start, and after optimisation with two weights in sequence."""
    options = {"maxiter": most, "ftol": 1e-6, "gtol": 0.0, "maxcor": 20}
    yield _said(piece.figures(theta))
    for weight in (1.0, 10.0):
        found = minimize(piece.cost(weight), theta.ravel(), jac=True, method="L-BFGS-B", options=options)
        theta = found.x.reshape(theta.shape)
        yield _said(piece.figures(theta))


def _said(figures: tuple[float, float, float]) -> str:
    outside, square, palm = figures
    # A constant drive has no power in the band.
    if not np.isfinite(outside):
        return "nothing"
    return f"{100 * outside:.2g} %, {square:.1f}, {palm:.1f}"
