"""The paper's loop (5.2): play, re-record, correct, play again, compare; optionally with iterative correction."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from midair.array_types import Array
from midair.correct import BeamGain, amplitude_gain, beam_drive, beam_gain, commanded_pressure, sine_amplitude
from midair.dsp import filter_response, strongest_window
from midair.errors import InputError
from midair.evaluate import apply_band_twice, compare
from midair.files import OpenedTake, open_take
from midair.model import ControlGrid, PressureFrames, Progress, SensorGrid, TransducerArray
from midair.physics import (
    SensorModel,
    cell_weights,
    focus_phase,
    playback_response,
    radiation_pressure,
    transfer_matrix,
)
from midair.pipeline import calibrated_pressure, check_size, compensate_pressure, map_pressure, required_lead
from midair.rig.correction.iteration import Pass, Stage, no_progress, play_pass, run_iterations
from midair.rig.opening import OpenRig, open_rig
from midair.rig.session import Session
from midair.settings import Mode, Settings
from midair.stages import settings_of
from midair.targets import add_lead, remove_lead
from midair.validation import checked_call

LONGEST = 1.0
"""Duration of the part of a recording that gives the expected gain, in s."""


def expected_gain(original: PressureFrames, asked: PressureFrames, settings: Settings) -> float:
    """Gain of a pass on a perfect array in the strongest second: mapping, interpolation, cells, hold, transducers."""
    # A cell averages over its aperture and its gel, while a focus is narrower and a pattern wider: a gain that is
    # measured at a focus alone would make the first pass several times too strong.
    lead = (asked.frames - original.frames) / 2 / asked.rate
    power = (original.pressure**2).sum(axis=(1, 2))
    start = lead + strongest_window(power, round(LONGEST * original.rate)) / original.rate
    part = asked.cut(max(0.0, start - lead), LONGEST + 2 * lead)
    expected, heard = _expected_reading(part, settings), apply_band_twice(part)
    first = min(round(lead * part.rate), part.frames // 4)
    inside = slice(first, part.frames - first)
    got = apply_band_twice(PressureFrames(pressure=expected, rate=part.rate, sensor=part.sensor, band=part.band))
    pair = [
        PressureFrames(pressure=each.pressure[inside], rate=part.rate, sensor=part.sensor, band=part.band)
        for each in (heard, got)
    ]
    return compare(pair[0], pair[1]).gain


def focus_on_cell(array: TransducerArray, sensor: SensorGrid, channel: int, settings: Settings) -> float:
    """Pressure in Pa that a cell of the default sensor reads of a full focus on its centre."""
    grid = settings.target.grid
    # For averages over cells: four points per pitch, up to one pitch beyond the outermost cells.
    size, place = {"rows": 4 * (sensor.rows + 2), "columns": 4 * (sensor.columns + 2)}, grid.centre
    points = ControlGrid(**size, pitch=sensor.pitch / 4, height=grid.height, centre=place)
    x, y = sensor.channel_position(channel)
    middle = np.array([x + grid.centre[0], y + grid.centre[1], grid.height])
    q = np.exp(1j * focus_phase(array, middle, acoustics=settings.acoustics))
    field = transfer_matrix(points, array, acoustics=settings.acoustics) @ q
    weights = cell_weights(SensorModel.usual(sensor), points, centre=grid.centre, between="waves")
    return float(weights[channel] @ radiation_pressure(field, settings.acoustics.medium))


def _expected_reading(part: PressureFrames, settings: Settings) -> Array:
    """Expected reading of the cells in Pa, shape (frame, row, column), from squares around the control points."""
    points, chosen = settings.target.grid, settings.compensation
    target = map_pressure(compensate_pressure(part, settings), settings).amplitude
    if not (chosen.precompensate and chosen.compensate == "sound"):

        def quieter(frequency: Array) -> Array:
            response = playback_response(frequency, part.rate, dynamics=chosen.dynamics)
            return np.abs(response)[:, None]

        target = filter_response(target, part.rate, quieter, reach=0.01)
    # Sound rounds the peaks of an interpolated amplitude and adds pressure beside them: for one modulated focus a first
    # pass is 1.13 times too strong with "lines", .99 with "steps", .89 with "waves".
    between = "lines" if settings.target.interpolate == "pressure" else "steps"
    weights = cell_weights(SensorModel.usual(part.sensor), points, centre=points.centre, between=between)
    pressed = radiation_pressure(target, settings.acoustics.medium) @ weights.T
    return pressed.reshape(part.pressure.shape)


MOST = 10.0
"""Largest factor by which the model's expected gain raises the first pass: half-wave rectification and averaging over a
cell leave a fifth."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamTest:
    """A focus played at several levels on one channel: commanded and measured amplitudes, and the line through them."""

    channel: int
    commanded: NDArray[np.float64]
    measured: NDArray[np.float64]
    line: BeamGain


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """Result of a correction loop."""

    settings: Settings
    original: PressureFrames
    """Pressure to reproduce."""
    reference: PressureFrames
    """The original filtered once more by the band, as a perfect rig would return it; passes are compared with it."""
    beam: BeamTest
    passes: tuple[Pass, ...]
    """Passes in order, without those that were taken back."""
    taken_back: int = 0
    """Number of iterative steps that increased the error."""
    end: str = ""
    """Reason why the iterative correction stopped; empty without one."""

    def __repr__(self) -> str:
        return f"<Loop of {len(self.passes)} passes, the last {self.passes[-1]!r}>"


def beam_test(rig: OpenRig, settings: Settings, *, top: float = 100.0, progress: Progress | None = None) -> BeamTest:
    """Measure the beam's gain over the model's, by a beating focus at levels up to `top` Pa on the centre channel."""
    middle = float(np.sqrt(settings.calibration.band[0] * settings.calibration.band[1]))
    # A period has at least four frames, as `beam_drive` requires.
    frequency = settings.target.rate / max(4, round(settings.target.rate / middle))
    cycles = max(4, round(0.2 * frequency))
    sensor, transducers = rig.listening(), rig.transducers
    channel = (sensor.grid.rows - 1) // 2 * sensor.grid.columns + (sensor.grid.columns - 1) // 2
    point = np.array([*sensor.grid.channel_position(channel), settings.target.grid.height])
    point[:2] += settings.target.grid.centre
    full = float(commanded_pressure(transducers, point, np.ones(1), acoustics=settings.acoustics)[0])
    drives = np.sqrt(np.linspace(1 / 6, 1, 6) * min(top / full, 1.0))
    drive = beam_drive(
        transducers,
        point,
        drives,
        frequency=frequency,
        cycles=cycles,
        rate=settings.target.rate,
        acoustics=settings.acoustics,
    )
    heard = calibrated_pressure(Session(rig=rig).rerecord(drive, progress=progress), sensor.calibration, settings)
    signal = heard.pressure.reshape(heard.frames, -1)[: drive.frames, channel]
    measured = sine_amplitude(signal, heard.rate, frequency=frequency, parts=6)
    # Half peak to peak, as in `sine_amplitude`, of the cell's reading: a cell is wider than the focus.
    on_cell = focus_on_cell(transducers, sensor.grid, channel, settings)
    # Hold and transducers attenuate the beat.
    dynamics, frames = settings.compensation.dynamics, settings.target.rate
    played = float(np.abs(playback_response(np.array([frequency]), frames, dynamics=dynamics))[0])
    commanded = on_cell * played * drives**2 / 2
    return BeamTest(channel=channel, commanded=commanded, measured=measured, line=beam_gain(commanded, measured))


@checked_call
def loop(
    original: PressureFrames | OpenedTake | str | Path,
    settings: Settings | Mode = "best",
    rig: OpenRig | str = "virtual",
    *,
    corrections: int = 1,
    iterate: int = 0,
    lead: float | None = None,
    fixed_place: bool = False,
    stage: Stage = no_progress,
) -> Loop:
    """Run the paper's loop (5.2): solve, play, re-record, correct, play again, compare; optionally iterate.

    The first pass is corrected by the beam's gain and by the model's expected gain of the cells; each further pass
    multiplies the pressure by the amplitude error of the pass before. Then follow passes that correct the waveform, see
    `rig.correction.iteration`. Passes are compared with the original as a perfect rig would return it.

    Parameters
    ----------
    original : OpenedTake, PressureFrames or path
        A recording with its calibration; or its pressure, in the settings' band and at their rate.
    settings : Settings or {"paper", "best", "quick", "finest"}
        Settings of every stage, or the name of a mode; "paper" is the loop of the paper.
    rig : OpenRig or str
        An entered rig with a sensor, or the name of an array that is opened for this call. A real array is solved for
        its stored calibration, unless the rig was opened with ``array_calibration="none"``.
    corrections : int
        Passes after the first that correct the amplitude; the paper has one.
    iterate : int
        Maximum number of passes after those that correct the waveform.
    lead : float, optional
        Silence in s around the original, in which a bias can rise; the mapping's own value if None.
    fixed_place : bool
        Count a shift and a turn of the pattern in the plane of the palm as distortion, also in the gain that corrects.
    stage : callable
        Called with the name of each stage at its start; returns its progress callback.

    Raises
    ------
    InputError
        If the rig has no sensor, or the sensor has no calibration.
    ExposureError
        If a drive exceeds the profile without an override.
    """
    chosen = settings_of(settings)
    if isinstance(original, str | Path):
        original = open_take(original)
    if isinstance(original, OpenedTake):
        original = calibrated_pressure(original.recording, original.calibration, chosen)
    if not (0 <= corrections <= 100 and 0 <= iterate <= 100):
        raise InputError(
            f"corrections: expected 0 to 100 amplitude and waveform corrections, got {corrections} and {iterate}"
        )
    how: Any = {"fixed_place": fixed_place, "stage": stage}
    if isinstance(rig, str):
        height, band = chosen.target.grid.height, chosen.calibration.band
        with open_rig(rig, height=height, cells=original.sensor, band=band) as opened:
            return loop(original, chosen, opened, corrections=corrections, iterate=iterate, lead=lead, **how)
    if chosen.target.mapping == "receptors":
        raise InputError("mapping: expected one that keeps the waveform in a loop, got receptors; use slow-bias")
    for name, instead in (("ears", "use --profile with --attenuate"), ("strength", "leave it out")):
        if (got := getattr(chosen.target, name)) is not None:
            raise InputError(f"{name}: expected none in a loop, which finds the level itself, got {got:g}; {instead}")
    check_size(original.frames, rig.transducers, chosen, parts=False)
    if rig.measured is not None:
        _, chosen, original = rig.measured.applied(rig.array.array, chosen, original)
    lead = required_lead(chosen) if lead is None else lead
    if not 0 <= lead < 10:
        raise InputError(f"lead: expected 0 to 10 s, got {lead:g} s")
    beam = beam_test(rig, chosen, progress=stage("beam test"))
    asked = add_lead(original, lead)
    # The model's expected gain of this recording, and the measured gain of the beam relative to the model.
    expected = expected_gain(original, asked, chosen)
    gain = chosen.target.gain * amplitude_gain(expected, limit=MOST) * amplitude_gain(beam.line.gain)
    reference = remove_lead(apply_band_twice(asked), original.frames)
    passes: list[Pass] = []
    for number in range(corrections + 1):
        if passes:
            # Relative to the gain so far, with which the pass before was played.
            gain *= amplitude_gain(passes[-1].comparison.gain)
        passes.append(play_pass(reference, asked, rig, chosen.but(gain=gain), f"pass {number + 1}", **how))
    further, taken_back, end = run_iterations(reference, passes[-1], rig, chosen, iterate, **how)
    return Loop(
        settings=chosen,
        original=original,
        reference=reference,
        beam=beam,
        passes=(*passes, *further),
        taken_back=taken_back,
        end=end,
    )
