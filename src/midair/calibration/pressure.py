"""Convert the sensor's output to the pressure that acted on it (paper, section 3)."""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from midair.array_types import Array, Complex
from midair.calibration.inverse import check_band_covered, crosstalk_inverse, inverse_response
from midair.dsp import Band, band_edges, band_energy, check_band, filter_response
from midair.errors import BandError, MismatchError, UnitError
from midair.model import BAND, Calibration, PressureFrames, Recording, Setting
from midair.recordings import dead_channels
from midair.validation import checked_call

LEAST = 1e-6
"""Smallest accepted share of a channel's variance inside the band: -60 dB."""


@checked_call
def calibrate(
    recording: Recording,
    calibration: Calibration | None = None,
    *,
    band: Band = BAND,
    edges: tuple[float, float] | None = None,
    floor: float = 0.05,
    crosstalk: Literal["keep", "undo"] = "keep",
    damping: float = 0.0,
) -> PressureFrames:
    """Undo each channel's frequency response within a band and remove everything outside it.

    Parameters
    ----------
    recording : Recording
        In V, counts or Pa.
    calibration : Calibration, optional
        Calibration of the same sensor in the same unit. None for a recording in Pa, which is only band-limited.
    band : tuple of float
        (low, high) in Hz; the amplitude is halved at these two corners.
    edges : tuple of float, optional
        Full widths of the raised-cosine edges around the two corners, in Hz. By default low / 2 and high / 20, or less
        to stay below half the rate: 15 to 25 Hz and 458 to 482 Hz.
    floor : float
        Density of the weakest relevant pressure, in Pa/sqrt(Hz); see `midair.calibration.inverse_response`.
    crosstalk : {"keep", "undo"}
        Whether to undo the crosstalk between cells with the calibration's matrix.
    damping : float
        Damping of the crosstalk inverse, 0 or more; see `midair.calibration.undo_matrix`.

    Returns
    -------
    PressureFrames
        Signed pressure in Pa at the rate of the recording.

    Raises
    ------
    BandError
        If the band does not fit the recording's rate, duration or calibration, or holds less than a millionth of every
        channel's variance.
    UnitError
        If a recording in V or counts comes without a calibration.
    MismatchError
        If the calibration is for another sensor or unit.
    InputError
        If floor or damping is invalid, or crosstalk = "undo" and the calibration has no crosstalk matrix.
    """
    band = check_band(band, recording.rate)
    edges = band_edges(band, recording.rate) if edges is None else (float(edges[0]), float(edges[1]))
    used = _fitting(recording, calibration, band)
    mix = crosstalk_inverse(used, crosstalk, damping)
    _check_content(recording, band)

    def undo(frequency: Array) -> Complex:
        return inverse_response(used, frequency, band, edges=edges, floor=floor)

    # Four periods of the narrowest edge on both sides.
    narrowest = min((width for width in edges if width > 0), default=recording.rate / 100)
    reach = min(4 / narrowest, 10 * recording.duration)
    pressure = filter_response(recording.samples, recording.rate, undo, reach=reach)
    if mix is not None:
        pressure = (pressure.reshape(len(pressure), -1) @ mix.T).reshape(pressure.shape)
    settings: dict[str, Setting] = {
        "band_hz": band,
        "edges_hz": edges,
        "floor_pa_per_sqrt_hz": floor,
        "calibration": "none: the recording is in Pa" if calibration is None else calibration.provenance.source,
        "calibration_id": used.identifier,
        "calibration_date": used.date,
        "calibration_version": used.version,
        "uncertainty": typical_uncertainty(used, band),
        "crosstalk": crosstalk if mix is None else f"undone with a damping of {damping:g}",
        "dead_channels": tuple(int(channel) for channel in np.flatnonzero(dead_channels(recording))),
    }
    return PressureFrames(
        pressure=pressure,
        rate=recording.rate,
        sensor=recording.sensor,
        band=band,
        provenance=recording.provenance.then("calibrate", settings, simulated=used.provenance.simulated),
    )


def typical_uncertainty(calibration: Calibration, band: Band) -> float | None:
    """Expanded uncertainty (k = 2) of the response magnitude: the median over band and channels.

    None for a calibration that was stated, not measured.
    """
    frequency = np.linspace(*band, 64)
    found = calibration.uncertainty_at(frequency)
    return None if found is None else float(2 * np.median(found))


def _fitting(recording: Recording, calibration: Calibration | None, band: Band) -> Calibration:
    if calibration is None:
        if recording.unit != "Pa":
            raise UnitError(
                f"calibrate: expected a calibration for a recording in {recording.unit}, got none; give the sensor's "
                f"file, or Calibration.flat of a sensitivity in {recording.unit}/Pa"
            )
        return Calibration.flat(recording.sensor, unit="Pa")
    have, want = calibration.sensor, recording.sensor
    if (have.name, have.shape) != (want.name, want.shape):
        raise MismatchError(
            f"calibration: expected one of sensor {want.name!r}, {want.rows} x {want.columns}, got one of "
            f"{have.name!r}, {have.rows} x {have.columns}; use the calibration of the sensor that made the recording"
        )
    if calibration.unit != recording.unit:
        raise MismatchError(
            f"calibration: expected one for a sensor output in {recording.unit}, got {calibration.unit}; "
            "use the calibration that was measured with this converter"
        )
    check_band_covered(calibration, band)
    return calibration


def _check_content(recording: Recording, band: Band) -> None:
    """Raise a BandError if no channel has a millionth (-60 dB) of its variance in the band."""
    low, high = band
    periods = recording.duration * (low or 1 / recording.duration)
    if recording.frames < 3 or periods < 1:
        raise BandError(
            f"recording: expected at least 3 frames and one period of {low:g} Hz, got {recording.frames} frames in "
            f"{recording.duration:g} s; record longer or raise the band"
        )
    if dead_channels(recording).all():
        raise BandError("recording: expected a changing signal, got a constant on every channel; check the sensor")
    share = _share_inside(recording, band)
    if share < LEAST:
        raise BandError(
            f"band: expected signal power between {low:g} and {high:g} Hz, got a share of {share:.1g} of the "
            f"variance; choose a band that contains the signal (rate: {recording.rate:g} Hz)"
        )


def _share_inside(recording: Recording, band: Band) -> float:
    """Largest share of a channel's variance in the band, or the first share found that is large enough.

    The whole recording and ever shorter segments are analysed, so that a short tap near one end counts too. For shorter
    segments the band is narrowed, so that power outside it does not leak in.
    """
    variance = recording.samples.var(axis=0).reshape(-1)
    inside = np.zeros_like(variance)
    # One channel at a time, because a spectrum takes several times the memory of its signal.
    for channel, one in enumerate(recording.samples.reshape(recording.frames, -1).T):
        for found in _inside(one, recording.rate, band):
            inside[channel] = max(inside[channel], float(found))
            if inside[channel] >= LEAST * variance[channel] > 0:
                return float(inside[channel] / variance[channel])
    return float(np.divide(inside, variance, out=np.zeros_like(inside), where=variance > 0).max())


def _inside(samples: Array, rate: float, band: Band) -> Iterator[Array]:
    """Mean square within the band by each segment length, for one channel."""
    low, high = band
    length = len(samples) // 4
    yield band_energy(samples, rate, band, resolution=rate / len(samples))
    while length >= 16 and low + 4 * rate / length < high - 4 * rate / length:
        # The window of `band_energy` leaks over four bins.
        inner = (low + 4 * rate / length, high - 4 * rate / length)
        yield band_energy(samples, rate, inner, resolution=rate / length)
        length //= 4
