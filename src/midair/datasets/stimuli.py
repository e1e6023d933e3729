"""The modulated foci of the paper's section 5.2, as pressure on the sensor."""

from typing import Literal, get_args

import numpy as np

from midair.errors import InputError, RateError
from midair.model import PressureFrames, Provenance, SensorGrid
from midair.model.arrays import positive

Stimulus = Literal["i", "ii", "iii"]


def am_stimulus(
    kind: Stimulus,
    *,
    peak: float = 60.0,
    duration: float = 0.5,
    rate: float = 1000.0,
    sensor: SensorGrid | None = None,
) -> PressureFrames:
    """Pressure of the modulated foci of the paper's section 5.2, as an array that can only push presents them.

    A modulation of frequency f is the raised sinusoid (1 - cos 2 pi f t) / 2. "i": 100 Hz on the first channel; "ii":
    100 Hz on the first and the last one; "iii": 25 Hz and 250 Hz in the ratio 3:2 on the first one.

    Parameters
    ----------
    kind : {"i", "ii", "iii"}
        Which of the three.
    peak : float
        Of the pressure, in Pa; "iii" comes to within 3 % of it.
    duration : float
        In s; the bins of a spectrum meet the modulation when it is a multiple of 40 ms.
    rate : float
        Frames per second, in Hz, above twice the highest modulation.
    sensor : SensorGrid, optional
        The cells; 4 x 4 at 11 mm by default.

    Returns
    -------
    PressureFrames
        Simulated, in Pa, 0 or more.

    Raises
    ------
    InputError
        If `kind` is none of the three.
    RateError
        If the rate is too low for the modulation.
    """
    sensor = sensor or SensorGrid()
    parts = _modulation(kind)
    if rate <= 2 * max(parts):
        raise RateError(f"rate of stimulus {kind}: expected above {2 * max(parts):g} Hz, got {rate:g} Hz")
    time = np.arange(max(1, round(positive(duration, "duration", "s") * rate))) / rate
    pressure = np.zeros((len(time), sensor.count))
    wave = np.sum([share * (0.5 - 0.5 * np.cos(2 * np.pi * f * time)) for f, share in parts.items()], axis=0)
    channels = (0, sensor.count - 1) if kind == "ii" else (0,)
    pressure[:, list(channels)] = positive(peak, "peak", "Pa") * wave[:, None]
    settings = {"kind": kind, "peak_pa": float(peak), "channels": channels, "frequencies_hz": tuple(parts)}
    return PressureFrames(
        pressure=pressure.reshape(-1, *sensor.shape),
        rate=rate,
        sensor=sensor,
        provenance=Provenance(source=f"virtual:AM {kind}", simulated=True).then("AM stimulus", settings),
    )


def _modulation(kind: Stimulus) -> dict[float, float]:
    """Frequency in Hz: share of the peak."""
    if kind in ("i", "ii"):
        return {100.0: 1.0}
    if kind == "iii":
        return {25.0: 0.6, 250.0: 0.4}
    raise InputError(f"stimulus: expected one of {', '.join(get_args(Stimulus))}, got {kind!r}")
