"""From what a sensor said to the pressure that acted on it (paper, section 3)."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from midair.calibration.apply.inverse import check_reach, default_taps, inverse_fir, inverse_response
from midair.calibration.apply.streaming_inverse import mixing
from midair.channels import channels
from midair.dsp import Band, band_edges, band_energy, check_band, filter_fir, filter_response
from midair.errors import BandError, InputError, MismatchError, UnitError
from midair.lazy_frames import LazyFrames, blocks, each_frame, moments
from midair.model import Calibration, PressureFrames, Recording, Setting
from midair.recordings import dead_channels

Method = Literal["fft", "fir"]
LEAST = 1e-6
"""Share of a channel's variance that must lie in the band: -60 dB."""

_LONG = 2**16
"""Frames in which the band of a reel is looked for: 1.4 s at 48 kHz, a minute at 1 kHz."""


def calibrate(
    recording: Recording,
    calibration: Calibration | None = None,
    *,
    band: Band = (20.0, 470.0),
    method: Method = "fft",
    edges: tuple[float, float] | None = None,
    taps: int | None = None,
    floor: float = 0.05,
    crosstalk: Literal["keep", "undo"] = "keep",
    damping: float = 0.0,
) -> PressureFrames:
    """Undo each channel's frequency response within a band and remove the rest.

    Parameters
    ----------
    recording : Recording
        In V or counts; or already in Pa.
    calibration : Calibration, optional
        Calibration of the same sensor and unit. None for a recording in Pa, which then only passes through the band.
    band : tuple of float
        (low, high) in Hz; half of the amplitude is left at these two corners.
    method : {"fft", "fir"}
        "fft": the whole recording at once. "fir": the filter that a stream would use, its delay taken away.
    edges : tuple of float, optional
        Whole widths of the raised-cosine edges around the two corners, in Hz. By default low / 2 and high / 20, or what
        fits below half the rate: 15 to 25 Hz and 458 to 482 Hz.
    taps : int, optional
        Length of the "fir" filter, odd. By default two periods of the narrowest edge: 201 at 1 kHz. On white noise in
        20 to 470 Hz its result then agrees with "fft" to 0.4 % rms, and to 2.5 % at the worst frequency (25 Hz);
        401 taps reach 0.06 % and 0.5 %, 801 taps 0.009 % and 0.09 %.
    floor : float
        Density of the weakest pressure worth hearing, in Pa/sqrt(Hz); see `midair.calibration.inverse_response`.
    crosstalk : {"keep", "undo"}
        Whether to undo what the cells feel of each other, by the calibration's matrix.
    damping : float
        Damping of crosstalk that is undone, 0 or more; see `midair.calibration.undo_matrix`.

    Returns
    -------
    PressureFrames
        Signed, in Pa, at the rate of the recording.

    Raises
    ------
    BandError
        If the band does not fit the recording's rate, duration or calibration, or holds less than a millionth of every
        channel's variance.
    UnitError
        If a recording in V or counts comes without a calibration.
    MismatchError
        If the calibration is of another sensor or unit.
    InputError
        If the method is none of the two, taps, floor or damping make no sense, or crosstalk is to be undone that nobody
        measured.
    """
    band = check_band(band, recording.rate)
    edges = band_edges(band, recording.rate) if edges is None else (float(edges[0]), float(edges[1]))
    if method not in get_args(Method):
        raise InputError(f"method of calibrate: expected one of {', '.join(get_args(Method))}, got {method!r}")
    used = _fitting(recording, calibration, band)
    mix = mixing(used, crosstalk, damping)
    _check_content(recording, band)
    if method == "fir":
        fir = inverse_fir(used, recording.rate, band, edges=edges, taps=taps, floor=floor)
        taps, pressure = len(fir), filter_fir(recording.samples, fir)
    else:
        taps, pressure = None, _by_fft(recording, used, band, edges, floor)
    if mix is not None:
        pressure = each_frame(pressure, lambda block: (block.reshape(len(block), -1) @ mix.T).reshape(block.shape))
    settings: dict[str, Setting] = {
        "band_hz": band,
        "edges_hz": edges,
        "method": method,
        "taps": taps,
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
    """Twice the standard uncertainty (k = 2) of the response's magnitude, the median over band and channels.

    None for a calibration that was stated, not measured.
    """
    frequency = np.linspace(*band, 64)
    found = calibration.uncertainty_at(frequency)
    return None if found is None else float(2 * np.median(found))


def _by_fft(
    recording: Recording, calibration: Calibration, band: Band, edges: tuple[float, float], floor: float
) -> NDArray[np.float64]:
    def undo(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        return inverse_response(calibration, frequency, band, edges=edges, floor=floor)

    # Four periods of the narrowest edge, either way: four times the reach of the default FIR filter.
    reach = min(2 * default_taps(recording.rate, edges) / recording.rate, 10 * recording.duration)
    return filter_response(recording.samples, recording.rate, undo, reach=reach)


def _fitting(recording: Recording, calibration: Calibration | None, band: Band) -> Calibration:
    if calibration is None:
        if recording.unit != "Pa":
            raise UnitError(
                f"calibrate: expected a calibration for a recording in {recording.unit}, got none; give the sensor's, "
                f"or state a sensitivity in {recording.unit}/Pa (Calibration.flat; --sensitivity on the command line)"
            )
        return Calibration.flat(recording.sensor, unit="Pa")
    have, want = calibration.sensor, recording.sensor
    if (have.name, have.shape) != (want.name, want.shape):
        raise MismatchError(
            f"calibration: expected one of sensor {want.name!r}, {want.rows} x {want.columns}, got one of "
            f"{have.name!r}, {have.rows} x {have.columns}; a calibration fits only the sensor it was made with"
        )
    if calibration.unit != recording.unit:
        raise MismatchError(
            f"calibration: expected one of a sensor that puts out {recording.unit}, got {calibration.unit}; "
            "give the one that was made with this converter"
        )
    check_reach(calibration, band)
    return calibration


def _check_content(recording: Recording, band: Band) -> None:
    """Refuse a recording whose every channel has less than a millionth (-60 dB) of its variance in the band."""
    low, high = band
    periods = recording.duration * (low or 1 / recording.duration)
    if recording.frames < 3 or periods < 1:
        raise BandError(
            f"recording: expected at least 3 frames and one period of {low:g} Hz, got {recording.frames} frames in "
            f"{recording.duration:g} s; record longer or raise the band"
        )
    if dead_channels(recording).all():
        raise BandError("recording: expected something that changes, got a constant on every channel; check the sensor")
    share = _share_inside(recording, band)
    if share < LEAST:
        raise BandError(
            f"band: expected something of the recording between {low:g} and {high:g} Hz, got a share of {share:.1g} of "
            f"its variance; choose a band where it has something (its rate is {recording.rate:g} Hz)"
        )


def _share_inside(recording: Recording, band: Band) -> float:
    """Largest share of a channel's variance that lies in the band, of a reel one that is large enough.

    Looked for over the whole recording and again in ever shorter segments, so that a short tap close to one of its ends
    counts too; the shorter a segment, the further from the corners, so that what is outside does not leak in. A reel is
    gone through in long blocks, until what was found will do.
    """
    variance = np.square(moments(recording.samples).spread)
    inside, share = np.zeros_like(variance), 0.0
    for block in blocks(recording.samples, _LONG if isinstance(recording.samples, LazyFrames) else recording.frames):
        # One channel after another: a spectrum takes several times the memory of what it is of.
        found = np.reshape([_inside(one, recording.rate, band) for one in channels(block)], variance.shape)
        inside = inside + found * (len(block) / recording.frames)
        share = float(np.divide(inside, variance, out=np.zeros_like(inside), where=variance > 0).max())
        if share >= LEAST:
            break
    return share


def _inside(samples: NDArray[np.float64], rate: float, band: Band) -> NDArray[np.float64]:
    """Mean square of what lies in the band, of (frame, ...), by the length of segment that finds most of it."""
    low, high = band
    inside, length = band_energy(samples, rate, band, resolution=rate / len(samples)), len(samples) // 4
    while length >= 16 and low + 4 * rate / length < high - 4 * rate / length:
        # Four bins are how far the window of `band_energy` leaks.
        inner = (low + 4 * rate / length, high - 4 * rate / length)
        inside = np.maximum(inside, band_energy(samples, rate, inner, resolution=rate / length))
        length //= 4
    return inside
