"""A sensor's calibration from what it said while a known pressure acted on it."""

import numpy as np
from numpy.typing import NDArray

from midair.calibrate.channels import dead_channels
from midair.errors import BandError, MismatchError
from midair.model import Calibration, PressureFrames, Recording
from midair.model.arrays import positive

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def measure_response(
    recording: Recording,
    pressure: PressureFrames,
    *,
    resolution: float = 2.0,
    coherence: float = 0.9,
    date: str = "",
) -> Calibration:
    """Frequency response and noise of each channel, from a recording of a known pressure.

    H1(f) = S_xy / S_xx, which noise at the output does not bias, and gamma^2 = |S_xy|^2 / (S_xx S_yy), by Welch's
    method (Bendat and Piersol, Random Data, 6.1 and 9.2). A bin counts only where gamma^2 is high enough on every live
    channel. What of the output is not coherent is the noise, S_nn = (1 - gamma^2) S_yy, its median over the bins: an
    upper bound, since distortion and leakage between the bins count too.

    Parameters
    ----------
    recording : Recording
        What the sensor said.
    pressure : PressureFrames
        What acted on its cells at the same time and rate: noise or a sweep that fills the band, for 16 segments of
        1 / resolution or more.
    resolution : float
        Spacing of the bins, in Hz.
    coherence : float
        Smallest gamma^2 of a bin, 0 to 1.
    date : str
        When it was measured, ISO 8601.

    Returns
    -------
    Calibration
        At the bins that count; a dead channel has response 0.

    Raises
    ------
    MismatchError
        If the two do not have the same cells, rate and number of frames.
    BandError
        If fewer than two bins count.
    """
    _check_pair(recording, pressure)
    segment = max(2, round(recording.rate / positive(resolution, "resolution", "Hz")))
    frequency, sxx, syy, sxy = _spectra(pressure.pressure, recording.samples, recording.rate, segment)
    response = np.divide(sxy, sxx, out=np.zeros_like(sxy), where=sxx > 0)
    both = sxx * syy
    gamma = np.divide(np.abs(sxy) ** 2, both, out=np.zeros_like(both), where=both > 0)
    alive = ~dead_channels(recording)
    # A segment's mean is removed before its spectrum is taken: 0 Hz says nothing.
    counts = (gamma[:, alive] >= coherence).all(axis=1) & (frequency > 0)
    if alive.sum() == 0 or counts.sum() < 2:
        raise BandError(
            f"response: expected two bins or more with a coherence of {coherence:g} on every live channel, got "
            f"{counts.sum() if alive.any() else 0}; press harder, longer, or over a wider band"
        )
    settings = {"resolution_hz": resolution, "coherence": coherence, "bins": int(counts.sum())}
    simulated = pressure.provenance.simulated
    return Calibration(
        sensor=recording.sensor,
        frequency=frequency[counts],
        response=np.where(alive, response[counts], 0),
        noise=np.sqrt(np.median(np.maximum((1 - gamma[counts]) * syy[counts], 0), axis=0)),
        unit=recording.unit,
        date=date,
        provenance=recording.provenance.then("measure response", settings, simulated=simulated),
    )


def _spectra(x: Array, y: Array, rate: float, segment: int) -> tuple[Array, Array, Array, Complex]:
    """Frequencies and one-sided S_xx, S_yy, S_xy under Hann segments that overlap by half."""
    from scipy.signal import csd, welch

    frequency, sxx = welch(x, rate, nperseg=segment, axis=0)
    syy = welch(y, rate, nperseg=segment, axis=0)[1]
    return frequency, sxx, syy, np.asarray(csd(x, y, rate, nperseg=segment, axis=0)[1], np.complex128)


def _check_pair(recording: Recording, pressure: PressureFrames) -> None:
    have = (pressure.sensor.shape, pressure.rate, pressure.frames)
    want = (recording.sensor.shape, recording.rate, recording.frames)
    if have != want:
        raise MismatchError(
            f"pressure: expected {want[2]} frames at {want[1]:g} Hz on {want[0]} cells like the recording's, got "
            f"{have[2]} at {have[1]:g} Hz on {have[0]}; align and resample it first"
        )
