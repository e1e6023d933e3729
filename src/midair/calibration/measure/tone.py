"""Sensitivity from one tone of known pressure (pistonphone), and scale of a response or a sound file in Pa."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from midair.array_types import Array, Complex
from midair.calibration.measure.frequency_response import widened
from midair.errors import BandError, InputError, MismatchError
from midair.model import Calibration, Measurement, Provenance, Recording
from midair.validation import positive

_PARTS = 10
"""Segments to which the tone is fitted; their scatter is part of the uncertainty."""


def measure_tone(
    recording: Recording,
    *,
    frequency: float,
    pressure: float,
    uncertainty: float = 0.0,
    reference: str = "pistonphone",
    date: str = "",
    version: int = 1,
) -> Calibration:
    """Measure the sensitivity of every channel at one frequency with a tone of known level.

    A sine is fitted to each segment (three-parameter fit of IEEE Std 1057) at the frequency that fits the whole
    recording best. The result is the mean over the segments; their scatter and the uncertainty of the tone give its
    uncertainty. The calibration has one bin, with phases relative to the mean of all channels.
    `scale_to_tone` scales a whole response to this level.

    `recording` was made while the tone acts on all cells. `frequency` is the nominal one in Hz, correct to 1 %,
    `pressure` the rms in Pa (114 dB are 10.02 Pa), `uncertainty` its relative standard uncertainty. `reference`, `date`
    and `version` are as in `Measurement` and `Calibration`. Raises BandError if the recording is too short or its rate
    too low for the tone, InputError if there is no tone.
    """
    positive(pressure, "pressure of the tone", "Pa")
    if not 0 <= uncertainty < 1:
        raise InputError(f"tone: expected an uncertainty as a part of 1, got {uncertainty:g}")
    if not 0 < frequency < recording.rate / 2:
        raise BandError(f"tone: expected below {recording.rate / 2:g} Hz, half the rate, got {frequency:g} Hz")
    needed = 4 * _PARTS / frequency
    if recording.duration < needed:
        raise BandError(
            f"tone: expected {needed:.3g} s or more for {_PARTS} segments of 4 cycles, got {recording.duration:.3g} s"
        )
    flat = recording.samples.reshape(recording.frames, -1)
    found = _refined(flat, recording.rate, frequency)
    time = np.arange(recording.frames // _PARTS * _PARTS).reshape(_PARTS, -1) / recording.rate
    wave, rest = _fit(flat[: time.size].reshape(*time.shape, -1), time, found)
    amplitude = wave.mean(axis=0)
    size = np.abs(amplitude)
    # The residual as white noise: its variance over half the rate is its density.
    noise = np.sqrt(2 * rest / recording.rate)
    heard = size > 0
    # Half of the variance of complex numbers is in the magnitude, the other half in the phase.
    random = wave.std(axis=0, ddof=1) / np.sqrt(2 * _PARTS) / np.where(heard, size, 1)
    if not (heard.any() and np.median(random[heard]) < 0.2):
        raise InputError(
            f"tone: expected a steady tone near {frequency:g} Hz, got an unsteady {size.max():.3g} {recording.unit} in "
            f"a noise of {np.sqrt(rest.max()):.3g} {recording.unit} rms; switch it on, and check its frequency"
        )
    magnitude = np.sqrt(widened(random, 2 * (_PARTS - 1)) ** 2 + uncertainty**2)
    explained = 1 - rest / np.maximum(flat.var(axis=0), 1e-300)
    turned = np.exp(-1j * np.angle(amplitude.sum()))
    details = {"frequency_hz": frequency, "found_hz": found, "pressure_pa": pressure, "uncertainty": uncertainty}
    cells = recording.sensor.shape
    nothing = np.zeros(cells)
    return Calibration(
        sensor=recording.sensor,
        frequency=np.array([found]),
        response=(amplitude * turned / (np.sqrt(2) * pressure)).reshape(1, *cells),
        noise=noise.reshape(cells),
        unit=recording.unit,
        date=date,
        version=version,
        provenance=Provenance(
            source=f"measured with {reference}",
            simulated=recording.provenance.simulated,
            notes=recording.provenance.notes,
        ).then("measure tone", details),
        measurement=Measurement(
            coherence=np.where(heard, np.clip(explained, 0, 1), 0).reshape(1, *cells),
            magnitude_uncertainty=np.where(heard, magnitude, 1).reshape(1, *cells),
            phase_uncertainty=np.full((1, *cells), np.pi),
            noise_density=noise.reshape(1, *cells),
            noise_uncertainty=np.full(cells, 1 / np.sqrt(2 * max(flat.shape[0] - 3 * _PARTS, 1))),
            delay=nothing,
            delay_uncertainty=nothing,
            reference_uncertainty=uncertainty,
            reference=reference,
            method=f"a tone of {found:.6g} Hz and {pressure:.6g} Pa rms, {_PARTS} segments",
        ),
    )


def scale_to_tone(shape: Calibration, tone: Calibration) -> Calibration:
    """Scale a frequency response to the level of a tone, channel by channel.

    The uncertainty that all bins of the shape share (that of its reference) is replaced by the uncertainty of the tone
    and of the shape at the tone's frequency.

    The band of `shape`, for example from a focused beam, covers the `tone` of `measure_tone`. Raises MismatchError if
    the two have different sensors or units, or `tone` has more than one bin; BandError if the tone is outside the
    shape's frequencies.
    """
    if (shape.sensor, shape.unit) != (tone.sensor, tone.unit) or len(tone.frequency) != 1:
        raise MismatchError(
            f"tone: expected one bin of sensor {shape.sensor.name!r} in {shape.unit}, got {len(tone.frequency)} bins "
            f"of {tone.sensor.name!r} in {tone.unit}"
        )
    at = float(tone.frequency[0])
    if not shape.frequency[0] <= at <= shape.frequency[-1]:
        raise BandError(
            f"tone: expected one within {shape.frequency[0]:g} to {shape.frequency[-1]:g} Hz, got {at:g} Hz"
        )
    was = np.abs(shape.response_at(tone.frequency)[0])
    factor = np.divide(np.abs(tone.response[0]), was, out=np.zeros_like(was), where=was > 0)
    settings = {"tone_hz": at, "tone": tone.identifier, "was": shape.identifier}
    return replace(
        shape,
        response=shape.response * factor,
        provenance=shape.provenance.then("anchor", settings, simulated=tone.provenance.simulated),
        measurement=_anchored_measurement(shape, tone),
        # The linearity was stated in Pa with the previous level of the response.
        linearity=None,
    )


def _anchored_measurement(shape: Calibration, tone: Calibration) -> Measurement | None:
    have, level = shape.measurement, tone.measurement
    if have is None or level is None:
        return None
    own = np.sqrt(np.maximum(have.magnitude_uncertainty**2 - have.reference_uncertainty**2, 0))
    there = np.array([np.interp(tone.frequency, shape.frequency, one) for one in own.reshape(len(own), -1).T])
    there = there.reshape(1, *shape.sensor.shape)
    magnitude = np.sqrt(own**2 + there**2 + level.magnitude_uncertainty**2)
    return replace(
        have,
        magnitude_uncertainty=magnitude,
        reference_uncertainty=level.reference_uncertainty,
        reference=f"{have.reference}; level: {level.reference}",
    )


def _refined(flat: Array, rate: float, frequency: float) -> float:
    """Frequency within 1 % (or a bin) of the nominal one at which a sine has most power, over all channels."""
    time = np.arange(len(flat)) / rate
    # With a window the spectrum has a single peak at the tone, without side lobes that could trap the search.
    centred = (flat - flat.mean(axis=0)) * np.hanning(len(flat))[:, None]

    def power(f: float) -> float:
        return float((np.abs(np.exp(-2j * np.pi * f * time) @ centred) ** 2).sum())

    # Steps of half a bin: no peak is narrower.
    step = 0.5 * rate / len(flat)
    reach = max(0.01 * frequency, 2 * step)
    tried = np.arange(frequency - reach, frequency + reach + step / 2, step)
    best = float(tried[np.argmax([power(f) for f in tried])])
    found = scipy.optimize.minimize_scalar(
        lambda f: -power(f), bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-7}
    )
    return float(found.x)


def _fit(samples: Array, time: Array, frequency: float) -> tuple[Complex, Array]:
    """Complex amplitude of a sine in each segment, shape (segment, channel), and the mean square of the residual."""
    turn = 2 * np.pi * frequency * time
    design = np.stack([np.cos(turn), np.sin(turn), np.ones_like(turn)], axis=-1)
    found = np.linalg.pinv(design) @ samples
    rest = samples - design @ found
    free = samples.shape[0] * (samples.shape[1] - 3)
    return found[:, 0] - 1j * found[:, 1], (rest**2).sum(axis=(0, 1)) / free


GRAVITY = 9.81
"""In m/s2."""

SILENT = 20e-6
"""Reference pressure of 0 dB, in Pa rms."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MicrophoneScale:
    """Scale of the samples of a microphone's sound file, which are relative to full scale, in Pa.

    Two simple references provide it: a tone of known level, such as a calibrator's 94 dB (1.00 Pa rms, IEC 60942), and
    a small weight that falls on the skin over the microphone. A weight m from a height h arrives with the momentum m
    sqrt(2 g h). If it does not bounce, this is the time integral of the force, and the pressure follows from the
    contact area. Air resistance and rebound are neglected: a weight that rebounds transfers up to twice the momentum.
    """

    scale: float
    """Pressure of a sample value of 1, in Pa."""
    words: str
    """Description of the measurement in one sentence."""


def scale_of_tone(samples: Array, rate: float, *, level: float = 94.0) -> MicrophoneScale:
    """Compute the scale from samples (frame,), in the file's units, of a tone of known `level` in dB re 20 uPa.

    Raises InputError if the tone has less than nine tenths of the power.
    """
    window = np.hanning(len(samples))
    power = np.abs(np.fft.rfft((samples - samples.mean()) * window)) ** 2
    peak = int(power[1:].argmax()) + 1 if len(power) > 1 else 0
    share = float(power[max(0, peak - 3) : peak + 4].sum() / (power.sum() or 1.0))
    if share < 0.9:
        raise InputError(
            f"reference: expected a tone with nine tenths of the power, got {100 * share:.0f} %; cut the recording to "
            "the tone, and record it without clipping"
        )
    # Power of the tone alone, by Parseval's theorem, corrected for the window.
    rms = float(np.sqrt(2 * power[max(0, peak - 3) : peak + 4].sum() / (len(samples) * (window**2).sum())))
    pressure = SILENT * 10 ** (level / 20)
    at = peak * rate / len(samples)
    return MicrophoneScale(
        scale=pressure / rms,
        words=f"A tone of {at:.4g} Hz at {level:g} dB ({pressure:.3g} Pa rms) has {rms:.3g} rms in the reference: 1 "
        f"means {pressure / rms:.4g} Pa.",
    )


def scale_of_drop(samples: Array, rate: float, *, mass: float, height: float, diameter: float) -> MicrophoneScale:
    """Compute the scale from a weight that drops on the skin over the microphone and stays there.

    `samples` (frame,), in the file's units, hold one impact, which should last ten frames or more. `mass` is in kg, the
    `height` of the fall and the `diameter` of the round contact area in m. Raises InputError if no impact stands out,
    or it is shorter than four frames.
    """
    for value, name, unit in ((mass, "mass", "kg"), (height, "height", "m"), (diameter, "diameter", "m")):
        positive(value, f"{name} of the drop", unit)
    change = samples - np.median(samples)
    change = change if change.max() >= -change.min() else -change
    peak = int(change.argmax())
    noise = float(np.median(np.abs(change)))
    below = np.flatnonzero(change <= 0)
    first = int(below[below < peak].max(initial=-1)) + 1
    last = int(below[below > peak].min(initial=len(change)))
    if change[peak] < 20 * noise or change[peak] <= 0:
        raise InputError("reference: expected one impact of at least twenty times the noise, got none")
    if last - first < 4:
        raise InputError(
            f"reference: expected an impact of 4 frames or more, got {last - first}; use a higher rate or softer skin"
        )
    area = np.pi * diameter**2 / 4
    impulse = mass * np.sqrt(2 * GRAVITY * height) / area
    scale = impulse / (float(change[first:last].sum()) / rate)
    return MicrophoneScale(
        scale=scale,
        words=f"{1e3 * mass:.3g} g from {1e3 * height:.3g} mm on {1e3 * diameter:.3g} mm bring {impulse:.3g} Pa s in "
        f"{1e3 * (last - first) / rate:.2g} ms: 1 means {scale:.4g} Pa, half as much if it bounced right back.",
    )
