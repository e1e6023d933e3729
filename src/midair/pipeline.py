"""The pipeline from a recording to a drive."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil

import numpy as np

from midair import ram
from midair.correct import EnvelopePrediction
from midair.devices import measure_exposure
from midair.dsp import resample
from midair.errors import InputError
from midair.evaluate import band_settling_frames
from midair.files import DEFAULT_PROFILE, profile_named
from midair.model import (
    AmplitudeFrames,
    Calibration,
    Drive,
    PressureFrames,
    Progress,
    Recording,
    Solution,
    TransducerArray,
    frame_range,
)
from midair.physics import MEASURED, UNLIKE, Transducers, check_frame_rate, focus_amplitude, level_if_unlike
from midair.settings import MOST_GAIN, Settings
from midair.solvers import Cells, Free, QuietPalm, Windows, check_memory, memory_of, one_blas_thread, solve, solve_parts
from midair.streaming import blocks, read_frames
from midair.targets import decouple, default_lead, precompensate, precompensate_sound, prepare


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reproduction:
    """Results of the stages of a reproduction."""

    pressure: PressureFrames
    target: AmplitudeFrames
    solution: Solution

    def strength(self) -> float:
        """Peak of the target relative to a single focus of the whole array at full drive."""
        drive = self.solution.drive
        focus = focus_amplitude(self.target.grid, drive.array, acoustics=drive.acoustics)
        return float(self.target.amplitude.max() / focus)

    def __repr__(self) -> str:
        return f"<Reproduction strength {self.strength():.3g}, {self.solution!r}>"


def calibrated_pressure(
    recording: Recording,
    calibration: Calibration | None,
    settings: Settings,
    start: float = 0.0,
    duration: float | None = None,
    *,
    from_rest: bool = False,
) -> PressureFrames:
    """Pressure on the sensor, as by `calibrate` with the settings' band, at their rate; all, or a part in s.

    With `from_rest` it was at rest before the first and after the last frame; otherwise the end values are held.
    """
    from midair.calibration import calibrate  # here: to play a drive needs no calibration

    band, rate = settings.calibration.band, settings.target.rate
    if not from_rest:
        # Cut after calibration, so that filters leave no edges.
        return resample_pressure(calibrate(recording, calibration, band=band), rate, start, duration)
    # A number of frames that is whole at the other rate too.
    ratio = Fraction(rate / recording.rate).limit_denominator(1000)
    pad = -(-band_settling_frames(band, recording.rate) // ratio.denominator) * ratio.denominator
    longer = replace(recording, samples=np.pad(recording.samples, ((pad, pad), (0, 0), (0, 0))))
    whole = resample_pressure(calibrate(longer, calibration, band=band), rate)
    first = pad * ratio.numerator // ratio.denominator
    return replace(whole, pressure=whole.pressure[first : whole.frames - first])


def resample_pressure(
    pressure: PressureFrames, rate: float, start: float = 0.0, duration: float | None = None
) -> PressureFrames:
    """The same pressure, band-limited, at another frame rate; all, or a part in s, which has the bits of the whole."""
    whole = start == 0 and duration is None
    if np.isclose(pressure.rate, rate, rtol=1e-9):
        return pressure if whole else pressure.cut(start, duration)
    frames = ceil(pressure.frames * Fraction(rate / pressure.rate).limit_denominator(1000))
    first, last = frame_range(start, duration, frames, rate, "cut")
    life = pressure.provenance.then("resample", {"from_hz": pressure.rate, "to_hz": rate})
    if not whole:
        life = life.then("cut", {"start_s": first / rate, "duration_s": (last - first) / rate})
    values = resample(pressure.pressure, pressure.rate, rate, part=slice(first, last))
    return replace(pressure, pressure=values, rate=rate, provenance=life)


def required_lead(settings: Settings) -> float:
    """Lead before and after a piece that the settings need, in s, for `led_in`."""
    return default_lead(settings.target.mapping, settings.calibration.band)


def compensate_pressure(pressure: PressureFrames, settings: Settings) -> PressureFrames:
    """Decouple and pre-compensate the pressure as the settings specify; the result is the input of `map_pressure`.

    Pre-compensation of the sound amplitude is part of `target_amplitude`.
    """
    chosen = settings.compensation
    if chosen.decouple:
        pressure = decouple(pressure, grid=settings.target.grid)
    if chosen.precompensate and chosen.compensate == "pressure":
        pressure = precompensate(pressure, dynamics=chosen.dynamics, ramp=chosen.ramp)
    return pressure


def map_pressure(pressure: PressureFrames, settings: Settings, *, streamed: bool = False) -> AmplitudeFrames:
    """Sound amplitude at the control points for a pressure from `compensate_pressure`, `streamed` as in `prepare`."""
    chosen = settings.target
    return prepare(
        pressure,
        mapping=chosen.mapping,
        grid=chosen.grid,
        medium=settings.acoustics.medium,
        interpolate=chosen.interpolate,
        gain=chosen.gain,
        circle=chosen.circle,
        streamed=streamed,
    )


def target_amplitude(pressure: PressureFrames, settings: Settings, *, streamed: bool = False) -> AmplitudeFrames:
    """Sound amplitude at the control points that reproduces the pressure: all stages before the solver.

    `streamed` is as in `prepare`. Raises InputError if a setting is out of range or unknown.
    """
    chosen = settings.compensation
    if chosen.compensate not in ("sound", "pressure"):
        raise InputError(f"compensate: expected sound or pressure, got {chosen.compensate!r}")
    target = map_pressure(compensate_pressure(pressure, settings), settings, streamed=streamed)
    if chosen.precompensate and chosen.compensate == "sound":
        target = precompensate_sound(target, dynamics=chosen.dynamics, ramp=chosen.ramp)
    return target


def with_fitted_gain(
    pressure: PressureFrames, array: TransducerArray, settings: Settings, *, streamed: bool = False
) -> Settings:
    """The settings with the gain for their strength, reduced where they limit the level at the ears.

    Unchanged if they have neither; `streamed` is as in `prepare`. Raises InputError if the target is zero everywhere.
    """
    if settings.target.ears is not None:
        limit = settings.target.ears
        strong = with_fitted_gain(pressure, array, settings.but(ears=None), streamed=streamed).but(
            strength=None, ears=limit
        )
        return strong.but(gain=strong.target.gain * _part_under(limit, pressure, array, strong, streamed))
    if settings.target.strength is None:
        return settings
    plain = settings.but(strength=None, gain=1.0)
    peak = float(target_amplitude(pressure, plain, streamed=streamed).amplitude.max())
    if not peak > 0:
        raise InputError("strength: expected a pressure above 0 in some frame, got silence; leave --strength out")
    focus = focus_amplitude(settings.target.grid, array, acoustics=settings.acoustics)
    # Sound amplitude is proportional to the square root of pressure, and so of gain.
    gain = (settings.target.strength * focus / peak) ** 2
    if gain > MOST_GAIN:
        raise InputError(f"strength: expected a piece that is not nearly silent, got one that needs gain {gain:.4g}")
    return settings.but(gain=gain)


def under_ears(drive: Drive, limit: float) -> float:
    """Level above a limit at ears and bystander, in dB, negative below it.

    The highest of: the exposure check in rooms of 14 to 30 °C, also for the nominal transducers of a measured array;
    and the sound by transducers that differ.
    """
    profile, array = profile_named(DEFAULT_PROFILE).under(limit), drive.array
    known = () if array.alike else (array.nominal,)
    found = [measure_exposure(replace(drive, array=each), each, profile) for each in (array, *known)]
    unlike = level_if_unlike(drive, profile, UNLIKE if array.alike else MEASURED)
    heard = [level - limit for level, place in zip(unlike, profile.places, strict=True) if place.enforced]
    return max(*(each.excess for each in found), *heard)


def weaker_settings(drive: Drive, settings: Settings) -> Settings | None:
    """Settings with less gain for a drive above their level at the ears; None if it is below, or if they have none."""
    limit = settings.target.ears
    above = -np.inf if limit is None else under_ears(drive, limit)
    return settings.but(gain=settings.target.gain * 10 ** (-(above + 0.1) / 10)) if above > 0 else None


_PROBED = 128
"""Loudest frames, and frames in regular distances, that are solved to find the gain for a level at the ears."""


def _part_under(
    limit: float, pressure: PressureFrames, array: TransducerArray, settings: Settings, streamed: bool
) -> float:
    """Part of the gain, up to 1, with which some frames of a target meet a level at the ears."""
    if settings.solver.name == "lm":
        # A thousand frames and more are solved for the gain.
        raise InputError(f"ears: expected a faster method, got {settings.solver.name}; use --mode quiet")
    target = target_amplitude(pressure, settings, streamed=streamed)
    power = np.concatenate([(block**2).sum(axis=1) for block in blocks(target.amplitude)])
    some = np.union1d(np.argsort(power)[-_PROBED:], np.arange(0, target.frames, max(1, target.frames // _PROBED)))
    amplitude = np.concatenate([read_frames(target.amplitude, frame, frame + 1) for frame in some.tolist()])
    method = settings.solver.solver()
    if isinstance(method, Free):
        # Successive frames are not alike here.
        settings = settings.but(method=replace(method, every=1))
    part, above = 1.0, np.inf
    for _ in range(6):
        probe = replace(target, amplitude=np.sqrt(part) * amplitude)
        above = under_ears(solve(probe, array, settings.solver, acoustics=settings.acoustics).drive, limit)
        if above <= -_SPARE:
            return part
        # Radiation pressure is proportional to the square of the sound.
        part *= 10 ** (-(above + _SPARE + 0.1) / 10)
    raise InputError(
        f"ears: expected a drive below {limit:g} dB, got one {above:.1f} dB above it after six solutions; "
        "use --mode quiet"
    )


_SPARE = 0.5
"""Distance in dB from the limit that the probed frames keep, for frames that are solved from their neighbours."""


def solve_with(
    target: AmplitudeFrames,
    array: TransducerArray,
    settings: Settings,
    *,
    bits: int | None = None,
    progress: Progress | None = None,
) -> Solution:
    """Solve for a target with the solver, the error terms and the air of the settings; `bits` are those of `solve`.

    Raises InputError if the solution would not fit into memory.
    """
    check_size(target.frames, array, settings.but(grid=target.grid), parts=False)
    made = solve(target, array, settings.solver, acoustics=settings.acoustics, bits=bits, progress=progress)
    return Solution.joined(list(compensate_envelope(iter([made]), target, array, settings)))


def compensate_envelope(
    parts: Iterator[Solution], target: AmplitudeFrames, array: TransducerArray, settings: Settings
) -> Iterator[Solution]:
    """Correct solutions by predicting the envelopes of the transducers, as measured or as the settings assume them.

    Solutions are unchanged if the transducers were not measured and the settings ask for no prediction, or with
    half-wave mapping: cells that are silent half of the time have zero slope.
    """
    chosen = settings.compensation
    if not (len(array.pole) or chosen.predict) or settings.target.mapping == "half-wave":
        yield from parts
        return
    means = settings.solver.means or Windows()
    silent = [term.points(target.grid) for term in settings.solver.quiet if isinstance(term, QuietPalm)]
    alike = Transducers.alike(array.count, chosen.dynamics)
    foresight = EnvelopePrediction(
        transducers=Transducers(pole=array.pole if len(array.pole) else alike.pole, response=array.response),
        dynamics=chosen.dynamics,
        places=means.sensor if isinstance(means, Cells) else means.places(target.grid),
        silent=silent[0] if silent else np.empty((0, 3)),
        linear=chosen.compensate,
        iterations=16,
    )
    blocks = foresight.corrected(parts, target)
    while True:
        with one_blas_thread():
            block = next(blocks, None)
        if block is None:
            return
        yield block


def check_size(frames: int, array: TransducerArray, settings: Settings, *, parts: bool) -> None:
    """Raise InputError if the method does not support a term of the settings, or the solution needs too much memory.

    With `parts`, the target is made and solved in parts.
    """
    settings.solver.check()
    grid, free = settings.target.grid, ram.available_memory()
    needed = memory_of((grid, frames), array, settings.solver, acoustics=settings.acoustics, parts=parts)
    # Weights of the cells at the points, and the amplitudes of a target that is made at once.
    needed += 8 * grid.count * (100 if parts else 100 + 4 * frames)
    check_memory(needed, free, points=grid.count, transducers=array.count)


def reproduce_stream(
    pressure: PressureFrames,
    array: TransducerArray,
    settings: Settings,
    *,
    early: bool = True,
    progress: Progress | None = None,
) -> tuple[AmplitudeFrames, Iterator[Solution]]:
    """`reproduce` for a pressure of any length: the target, and an iterator over the blocks of its solution.

    `early` is that of `solve_parts`. Raises RateError if the array cannot take frames at the pressure's rate.
    """
    check_frame_rate(pressure.rate, array.frequency)
    check_size(pressure.frames, array, settings, parts=True)
    settings = with_fitted_gain(pressure, array, settings, streamed=True)
    noted = replace(pressure, provenance=settings.noted(pressure.provenance))
    target = target_amplitude(noted, settings, streamed=True)
    parts = solve_parts(target, array, settings.solver, early=early, acoustics=settings.acoustics, progress=progress)
    return target, compensate_envelope(parts, target, array, settings)


def reproduce(
    pressure: PressureFrames, array: TransducerArray, settings: Settings, *, progress: Progress | None = None
) -> Reproduction:
    """Compute the drive that reproduces a pressure: prepare, then solve.

    All settings are stored as a step of the drive's provenance; `Settings.of` restores them. Raises RateError if the
    array cannot take frames at the pressure's rate.
    """
    check_frame_rate(pressure.rate, array.frequency)
    check_size(pressure.frames, array, settings, parts=False)
    settings = with_fitted_gain(pressure, array, settings)
    while True:
        known = replace(pressure, provenance=settings.noted(pressure.provenance))
        target = target_amplitude(known, settings)
        solution = solve_with(target, array, settings, progress=progress)
        weaker = weaker_settings(solution.drive, settings)
        if weaker is None:
            return Reproduction(pressure=pressure, target=target, solution=solution)
        settings = weaker
