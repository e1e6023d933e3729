"""Commands that measure a calibration: `calibrate measure`, `tone`, `beam`, and `bench` to practise."""

import re
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from cyclopts import Parameter

from midair.calibration import BeamPlan, BeamSetting, MeasureSettings, measure_calibration, measure_tone, scale_to_tone
from midair.cli.commands.calibrate.output import OutputOptions, require_calibration
from midair.cli.console import out, progress_bars
from midair.cli.exposure_options import AirOptions, ExposureOptions, print_air
from midair.cli.import_options import stated_sensitivity
from midair.cli.options import Frequency, Length, Time
from midair.cli.quantities import quantity
from midair.errors import InputError
from midair.files import open_take
from midair.model import HEIGHT, Acoustics, Medium
from midair.rig import (
    PRACTICE_RECORDINGS,
    ReferenceChoice,
    VirtualRig,
    array_named,
    calibrate_by_beam,
    read_silence,
    read_takes,
    sensor_named,
    write_practice_recordings,
)

Files = Annotated[tuple[Path, ...], Parameter(consume_multiple=True)]
Cells = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]
"""Channel numbers, or "all"."""


def measure_command(
    *recordings: Path,
    reference: Files = (),
    reference_channel: int | None = None,
    reference_sensitivity: str | None = None,
    reference_diameter: Annotated[float | None, quantity("m")] = None,
    reference_uncertainty: float = 0.0,
    reference_name: str = "",
    cell: Cells = (),
    quiet: Path | None = None,
    resolution: Frequency = 1.0,
    coherence: float = 0.9,
    options: OutputOptions | None = None,
) -> None:
    """Measure a calibration against a reference sensor, with noise or sweeps on all cells or on each cell.

    Five levels give the linearity, recordings of single cells the crosstalk, repeated recordings the repeatability.

    Parameters
    ----------
    recordings
        Recordings of the sensor under noise or a sweep of the whole band, 12 s or more each.
    reference
        Recordings of the reference sensor, one per recording, started at the same time.
    reference_channel
        Channel of the recordings that carries the reference, instead of --reference.
    reference_sensitivity
        From the certificate of the reference, such as 50mV/Pa; for a force cell 10mV/N and --reference-diameter.
    reference_diameter
        Diameter of the round tip of a force cell, such as 8mm.
    reference_uncertainty
        Relative uncertainty (k = 2) of the reference from its certificate: 0.02 for 2 %.
    reference_name
        Make, model and serial number of the reference.
    cell
        Cell under load in each recording: channel numbers from 0, or all. [default: from the notes of the recordings]
    quiet
        Recording without load, to measure the noise.
    resolution
        Frequency resolution.
    coherence
        Lowest coherence of a frequency bin to use it.

    Examples
    --------
    $ midair calibrate measure bench/all-1Pa.h5 --reference bench/all-1Pa-reference.h5 --reference-sensitivity 50mV/Pa
    """
    options = options or OutputOptions()
    if not recordings:
        raise InputError("recordings: expected one or more, got none; see midair calibrate measure --help")
    choice = ReferenceChoice(
        sensitivity=_sensitivity(reference_sensitivity, reference_diameter),
        uncertainty=reference_uncertainty / 2,
        name=reference_name,
        channel=reference_channel,
    )
    takes, notes = read_takes(recordings, reference, choice, cells=_cells(cell) if cell else None)
    sensor = takes[0].recording.sensor
    options.path(sensor)
    calibration = measure_calibration(
        takes,
        quiet=None if quiet is None else read_silence(quiet),
        settings=MeasureSettings(resolution=resolution, coherence=coherence),
        date=options.day,
        version=options.version(sensor),
    )
    options.write(calibration, notes)


def tone_command(
    recording: Path,
    /,
    *,
    frequency: Frequency = 250.0,
    pressure: str,
    uncertainty: float = 0.0,
    reference_name: str = "pistonphone",
    shape: Path | None = None,
    options: OutputOptions | None = None,
) -> None:
    """Measure the sensitivity of every channel with a tone of known level, such as that of a pistonphone.

    Parameters
    ----------
    recording
        Recording of the sensor with the tone on all cells.
    frequency
        Frequency of the tone.
    pressure
        Rms pressure of the tone, such as 10Pa or 114dB (re 20 µPa).
    uncertainty
        Relative uncertainty (k = 2) of the pressure from its certificate: 0.02 for 2 %.
    reference_name
        Make, model and serial number of the source.
    shape
        Calibration over frequency of the same sensor, such as one by beam; it is scaled to the level of the tone.

    Examples
    --------
    $ midair calibrate tone tone.h5 --frequency 250Hz --pressure 114dB
    """
    options = options or OutputOptions()
    said = open_take(recording).recording
    options.path(said.sensor)
    calibration = measure_tone(
        said,
        frequency=frequency,
        pressure=_tone_pressure(pressure),
        uncertainty=uncertainty / 2,
        reference=reference_name,
        date=options.day,
        version=options.version(said.sensor),
    )
    options.write(calibration if shape is None else scale_to_tone(require_calibration(shape), calibration), [])


def beam_command(
    sensor: str = "virtual",
    /,
    *,
    device: str = "virtual",
    levels: int = 6,
    top: Annotated[float, quantity("Pa")] = 100.0,
    height: Length = HEIGHT,
    aperture: Length = 8e-3,
    spread: Length = 1e-3,
    pressure_uncertainty: float = 0.3,
    air: AirOptions | None = None,
    exposure: ExposureOptions | None = None,
    seed: int = 0,
    options: OutputOptions | None = None,
) -> None:
    """Measure a calibration with a focused beam on every cell, without a reference (the paper's section 5.2).

    Differences between channels are accurate; the overall level relies on the model of the array.
    To correct the level with a pistonphone, use midair calibrate tone --shape.

    Parameters
    ----------
    sensor
        virtual, or a sensor as in midair record, lying face down over the centre of the array.
    device
        virtual, or an array as in midair play.
    levels
        Number of pressure levels per cell, 5 or more.
    top
        Highest pressure in the centre of the focus.
    height
        Height of the sensor above the array.
    aperture
        Side of the square over which a cell averages the pressure.
    spread
        Standard deviation of the point spread in the gel.
    pressure_uncertainty
        Relative uncertainty (k = 2) of the array's radiation pressure.
    air
        Air of the room; it decides where the beam is focused. [default: 22C and 50%]
    exposure
        Exposure profile; a beam that exceeds it is refused: lower --top.
    seed
        Random seed of a virtual rig.

    Examples
    --------
    $ midair calibrate beam
    """
    options, room = options or OutputOptions(), (air or AirOptions()).medium()
    medium = room or Medium.at(temperature=22.0, humidity=0.5)
    rig = VirtualRig(seed=seed, height=height)
    skin = rig.skin() if device == "virtual" else None
    choices = (exposure or ExposureOptions()).choices(room)
    setting = BeamSetting(
        height=height, aperture=aperture, spread=spread, pressure_uncertainty=pressure_uncertainty / 2
    )
    source = rig.sensor(rig.skin() if skin is None else skin) if sensor == "virtual" else sensor_named(sensor, rig)
    array = rig.array_device(skin) if device == "virtual" else array_named(device)
    print_air(medium, stated=room is not None)
    with progress_bars() as stage, array, source:
        options.path(source.grid)
        calibration = calibrate_by_beam(
            array,
            source,
            BeamPlan(levels=levels, top=top),
            setting=setting,
            acoustics=Acoustics(medium=medium),
            exposure=choices,
            date=options.day,
            version=options.version(source.grid),
            progress=stage("beam on each cell"),
        )
    options.write(calibration, [])


def bench_command(
    folder: Path, /, *, kind: Literal["noise", "sweep"] = "noise", duration: Time = 15.0, seed: int = 0
) -> None:
    """Simulate recordings of a calibration bench, to practise midair calibrate measure; all are marked SIMULATED.

    Parameters
    ----------
    folder
        Output folder: recordings of sensor and reference on all cells at five levels, on each cell, and of noise.
    kind
        Signal on the sensor.
    duration
        Length of each recording.
    seed
        Random seed.

    Examples
    --------
    $ midair calibrate bench bench --kind sweep
    """
    with progress_bars(f"simulate {kind} of {duration:g} s", PRACTICE_RECORDINGS) as stage:
        progress = stage("simulate")
        command = write_practice_recordings(folder, kind=kind, duration=duration, seed=seed, progress=progress)
    out().print("now measure:", command, sep="\n")


def _cells(words: tuple[str, ...]) -> list[int | None]:
    for word in words:
        if word != "all" and not word.isdecimal():
            raise InputError(f"--cell: expected channel numbers from 0, or all, got {word!r}")
    return [None if word == "all" else int(word) for word in words]


def _sensitivity(text: str | None, diameter: float | None) -> float | None:
    """Sensitivity in V/Pa; that of a force cell is V/N times the area of its tip."""
    if text is None:
        return None
    if diameter is None:
        return stated_sensitivity(text, "V/Pa", "--reference-sensitivity")
    return stated_sensitivity(text, "V/N", "--reference-sensitivity") * np.pi * diameter**2 / 4


def _tone_pressure(text: str) -> float:
    """Rms pressure in Pa; decibels are re 20 µPa."""
    level = re.fullmatch(r"\s*([-+]?\d+(?:\.\d*)?)\s*dB\s*", text)
    if level is not None:
        return 20e-6 * 10 ** (float(level[1]) / 20)
    return stated_sensitivity(text, "Pa", "--pressure")
