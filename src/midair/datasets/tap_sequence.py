"""Taps on each cell in turn, as pressure on the sensor, to identify the cell of each channel."""

import numpy as np

from midair.model import RATE, PressureFrames, Provenance, SensorGrid
from midair.validation import positive


def taps(
    *,
    every: float = 1.0,
    quiet: float = 1.0,
    peak: float = 30.0,
    spread: float = 0.25,
    rate: float = RATE,
    seed: int = 0,
    sensor: SensorGrid | None = None,
) -> PressureFrames:
    """A half sine of 20 ms on each cell, row by row, with random strengths; the neighbouring cells get a part of it.

    Parameters
    ----------
    every : float
        Time between two taps, in s, with a random delay of 0.2 to 0.4 of it.
    quiet : float
        Time before the first tap, in s.
    peak : float
        Upper limit of the peak pressure of a tap, in Pa; the lower limit is a third of it.
    spread : float
        Share of the pressure on the cells beside a tapped one; its square on the diagonal ones.
    rate : float
        In Hz.
    sensor : SensorGrid, optional
        4 x 4 at 11 mm by default.
    """
    sensor, rng = sensor or SensorGrid(), np.random.default_rng(seed)
    every, rate = positive(every, "time between taps", "s"), positive(rate, "rate", "Hz")
    push = np.sin(np.pi * np.arange(round(0.02 * rate)) / (0.02 * rate))
    pressure = np.zeros((round((quiet + every * sensor.count) * rate) + len(push), *sensor.shape))
    rows, columns = np.mgrid[: sensor.rows, : sensor.columns]
    for cell in range(sensor.count):
        row, column = divmod(cell, sensor.columns)
        away = np.abs(rows - row) + np.abs(columns - column)
        begin = round((quiet + every * (cell + rng.uniform(0.2, 0.4))) * rate)
        strength = positive(peak, "peak", "Pa") * rng.uniform(1 / 3, 1)
        pressure[begin : begin + len(push)] += strength * push[:, None, None] * np.where(away < 3, spread**away, 0)
    settings = {"every_s": every, "quiet_s": quiet, "peak_pa": float(peak), "spread": float(spread), "seed": seed}
    return PressureFrames(
        pressure=pressure,
        rate=rate,
        sensor=sensor,
        provenance=Provenance(source="virtual:taps", simulated=True).then("taps", settings),
    )
