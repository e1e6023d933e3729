"""Commands that make and check a reproduction: solve, play, loop, compare."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from midair.cli.app import app
from midair.cli.arrays import PlayOptions, play_on_array
from midair.cli.options import BandOptions, SolveOptions, Time
from midair.cli.quantity import quantity
from midair.cli.recordings import may_write
from midair.cli.show import banner, print_figures, print_json, print_rows, stages
from midair.devices import load_placement
from midair.evaluate import Comparison, compare
from midair.flow import Settings, felt, reproduce
from midair.model import PressureFrames, Provenance, Setting, TransducerArray
from midair.rig.loop import run_loop
from midair.rig.names import check_array_name
from midair.rig.playback import rerecord
from midair.rig.report import write_report
from midair.rig.virtual import VirtualRig
from midair.store import load, load_calibration, load_solution, save, save_solution


@app.command(name="solve")
def solve_command(
    source: Path,
    output: Path | None = None,
    /,
    *,
    options: SolveOptions | None = None,
    start_at: Time = 0.0,
    duration: Annotated[float | None, quantity("s")] = None,
    placement: Path | None = None,
    force: bool = False,
) -> None:
    """Work out the drive with which the array presses as the sensor felt, frame by frame.

    Parameters
    ----------
    source
        A recording with a calibration.
    output
        NAME.drive.h5; the source's name if not given.
    options
        Of every stage.
    start_at
        Where in the recording to begin.
    duration
        How much of the recording; all that is left if not given.
    placement
        TOML file with position and rotation of the array's units; two by two side by side if not given.
    force
        Write over a file that is there.
    """
    settings = (options or SolveOptions()).settings()
    array = TransducerArray.autd3() if placement is None else load_placement(placement).array()
    target = output or Path(source.name.removesuffix(source.suffix) + ".drive.h5")
    may_write(target, force)
    pressure = _felt(source, settings, start_at, duration)
    banner(pressure.provenance.simulated)
    with stages() as stage:
        made = reproduce(pressure, array, settings, progress=stage("solve"))
    save_solution(made.solution, target, target=made.target)
    solution = made.solution
    plays = np.array([status != "silent" for status in solution.status])
    error = 100 * solution.error[plays] if plays.any() else np.zeros(1)
    print_rows(
        [
            ("drive", f"{target} for {array.name}, {array.count} transducers"),
            ("frames", f"{made.target.frames} at {settings.rate:g} Hz, {int((~plays).sum())} silent"),
            ("strength", f"{made.strength(settings):.3f} of a single full focus"),
            ("E", f"mean {error.mean():.1f} %, worst {error.max():.1f} %"),
            ("solver", f"{settings.method}, {solution.iterations[plays].mean():.1f} iterations a frame"),
        ]
    )


@app.command(name="play")
def play_command(
    source: Path,
    /,
    *,
    device: str = "virtual",
    output: Path | None = None,
    seed: int = 0,
    force: bool = False,
    options: PlayOptions | None = None,
) -> None:
    """Play a drive, and re-record what it presses when the device is virtual.

    Nothing is played on an array or on its emulator that exceeds the exposure profile, unless someone answers for it.
    Ctrl-C stops, and so does midair stop in another terminal.

    Parameters
    ----------
    source
        NAME.drive.h5.
    device
        virtual: an array and a sensor that exist only here. autd3, autd3:INTERFACE: units over Ethernet.
        autd3:emulator: their emulator. pyautd3, pyautd3:INTERFACE: older units over EtherCAT. pyautd3:audit,
        pyautd3:nop: no units.
    output
        The re-recording of a virtual device; NAME.rerecorded.h5 if not given.
    seed
        Of the virtual rig's strengths and noise.
    force
        Write over a file that is there.
    options
        Of exposure and of arrays.
    """
    options = options or PlayOptions()
    if device != "virtual":
        return play_on_array(source, device, options)
    target = output or Path(source.name.removesuffix(".h5").removesuffix(".drive") + ".rerecorded.h5")
    may_write(target, force)
    admission = options.admit(load_solution(source).drive, gated=False)
    drive = admission.drive
    rig = VirtualRig(array=drive.array, seed=seed)
    skin = rig.skin()
    banner(True)
    with stages() as stage, rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        recording = rerecord(drive, array, sensor, progress=stage("play and re-record"))
    save(recording, target, calibration=sensor.calibration)
    print_rows(
        [
            ("played", f"{drive.frames} frames at {drive.rate:g} Hz on {device}"),
            ("re-recorded", f"{target}, {recording.frames} frames at {recording.rate:g} Hz"),
            ("exposure", f"on a real array: {admission.exposure.verdict()}"),
        ]
    )
    return None


@app.command(name="loop")
def loop_command(
    source: Path,
    output: Path | None = None,
    /,
    *,
    device: str = "virtual",
    options: SolveOptions | None = None,
    start_at: Time = 0.0,
    duration: Annotated[float | None, quantity("s")] = None,
    corrections: int = 1,
    seed: int = 0,
    force: bool = False,
    json: bool = False,
) -> None:
    """Take a recording through everything: solve, play, re-record, correct, play again, compare, report.

    Parameters
    ----------
    source
        A recording with a calibration.
    output
        The report, NAME.html; the source's name if not given.
    device
        virtual: an array and a sensor that exist only here.
    options
        Of every stage.
    start_at
        Where in the recording to begin.
    duration
        How much of the recording; all that is left if not given.
    corrections
        How often to correct the amplitude and play again.
    seed
        Of the virtual rig's strengths and noise.
    force
        Write over a file that is there.
    json
        Print JSON for a program.
    """
    check_array_name(device)
    target = output or Path(source.name.removesuffix(source.suffix) + ".html")
    may_write(target, force)
    settings = (options or SolveOptions()).settings()
    original = _felt(source, settings, start_at, duration)
    rig = VirtualRig(seed=seed, height=settings.grid.height)
    skin = rig.skin()
    banner(True)
    with stages() as stage, rig.array_device(skin) as array, rig.sensor(skin) as sensor:
        loop = run_loop(original, array, sensor, settings, corrections=corrections, stage=stage)
    write_report(loop, target, commands=(f"midair loop {source.name} {target.name}",))
    figures = {f"pass {number + 1}": one.comparison.figures() for number, one in enumerate(loop.passes)}
    if json:
        print_json(
            {"report": str(target), "simulated": True, "passes": [_plain(one.comparison) for one in loop.passes]}
        )
        return
    print_figures("before and after correction", figures)
    print_rows([("report", str(target))])


@app.command(name="compare")
def compare_command(
    original: Path,
    reproduced: Path,
    /,
    *,
    options: BandOptions | None = None,
    json: bool = False,
) -> None:
    """Compare a re-recording with its original: waveform, spectrum, level, place and delay.

    Band, rate, and the part of the original that was played are those that the re-recording says it was made with.

    Parameters
    ----------
    original
        A recording with a calibration.
    reproduced
        What was re-recorded of its reproduction.
    options
        Of the band, where the re-recording does not say.
    json
        Print JSON for a program.
    """
    again = load(reproduced)
    settings = _made_with(again.provenance, (options or BandOptions()).settings())
    before = _same_part(_felt(original, settings), again.provenance)
    comparison = compare(before, _felt(reproduced, settings))
    if json:
        return print_json(_plain(comparison))
    banner(comparison.simulated)
    print_figures(f"{reproduced.name} against {original.name}", {"": comparison.figures()})
    return None


def _felt(source: Path, settings: Settings, start: float = 0.0, duration: float | None = None) -> PressureFrames:
    """What the sensor felt in a part of a recording; all of it is calibrated first: cuts leave no edge."""
    calibration = load_calibration(source) if source.suffix in (".h5", ".hdf5") else None
    pressure = felt(load(source), calibration, settings)
    return pressure if start == 0 and duration is None else pressure.cut(start, duration)


def _step(provenance: Provenance, stage: str) -> Mapping[str, Setting]:
    """The settings of the last step of that name; none if there was none."""
    return next((step.settings for step in reversed(provenance.steps) if step.stage == stage), {})


def _made_with(provenance: Provenance, settings: Settings) -> Settings:
    """The settings with the band and rate that a re-recording's drive was made with."""
    band, rate = _step(provenance, "calibrate").get("band_hz"), _step(provenance, "play").get("rate_hz")
    if isinstance(band, tuple) and len(band) == 2:
        low, high = (float(edge) for edge in band if isinstance(edge, int | float))
        settings = replace(settings, band=(low, high))
    return replace(settings, rate=float(rate)) if isinstance(rate, int | float) else settings


def _same_part(pressure: PressureFrames, provenance: Provenance) -> PressureFrames:
    cut = _step(provenance, "cut")
    start, duration = cut.get("start_s"), cut.get("duration_s")
    if isinstance(start, int | float) and isinstance(duration, int | float):
        return pressure.cut(float(start), float(duration))
    return pressure


def _plain(comparison: Comparison) -> dict[str, object]:
    figures = {name: {"value": value, "unit": unit} for name, (value, unit) in comparison.figures().items()}
    return {"simulated": comparison.simulated, "figures": figures}
