"""Commands that edit recordings: cut, join, resample, trim, gain, mask."""

import math
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from midair import recordings
from midair.cli.import_options import parse_names, parsed
from midair.cli.options import Force, Frequency, Json, OptionalTime, Output, Source, Time
from midair.cli.output import may_write, print_written, recording_figures, recording_rows
from midair.errors import InputError
from midair.files import contents, open_take, save
from midair.model import Calibration, Recording

HIGHEST = 1e6
"""Highest rate that `resample` accepts, in Hz."""

Names = Annotated[tuple[str, ...], parsed(parse_names, "NUMBERS")]


def cut_command(
    source: Source,
    output: Path,
    /,
    *,
    start: Time = 0.0,
    end: OptionalTime = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Extract a part of a recording.

    Parameters
    ----------
    output
        File to write, in any format that midair can write.
    start
        Start of the part.
    end
        End of the part. [default: end of the recording]

    Examples
    --------
    $ midair cut take.h5 part.h5 --start 0.4s --end 0.9s
    """
    may_write(output, force)
    _write(recordings.cut(open_take(source, streamed=True).recording, start, end), [source], output, json=json)


def join_command(*files: Path, force: Force = False, json: Json = False) -> None:
    """Join recordings of the same sensor end to end.

    Parameters
    ----------
    files
        Two or more recordings in order, then the file to write.

    Examples
    --------
    $ midair join take.h5 part.h5 both.h5
    """
    if len(files) < 3:
        raise InputError(f"join: expected two or more recordings and a file to write, got {len(files)} names")
    *sources, output = files
    may_write(output, force)
    _write(
        recordings.join([open_take(source, streamed=True).recording for source in sources]), sources, output, json=json
    )


def resample_command(
    source: Source, output: Output, /, *, rate: Frequency, force: Force = False, json: Json = False
) -> None:
    """Change the frame rate of a recording.

    Parameters
    ----------
    rate
        New frame rate.

    Examples
    --------
    $ midair resample take.h5 fine.h5 --rate 4kHz
    """
    may_write(output, force)
    if rate > HIGHEST:
        raise InputError(f"--rate: expected at most {HIGHEST / 1e6:g} MHz, got {rate / 1e6:g} MHz; is the unit right?")
    _write(recordings.resample(open_take(source, streamed=True).recording, rate), [source], output, json=json)


def trim_command(
    source: Source,
    output: Output,
    /,
    *,
    share: float = 0.05,
    margin: Time = 0.05,
    force: Force = False,
    json: Json = False,
) -> None:
    """Remove silence from both ends of a recording.

    Parameters
    ----------
    share
        Silence threshold as a fraction of the largest change of any channel.
    margin
        Silence to keep at both ends.

    Examples
    --------
    $ midair trim take.h5 short.h5
    """
    may_write(output, force)
    _write(
        recordings.trim(open_take(source, streamed=True).recording, share=share, margin=margin),
        [source],
        output,
        json=json,
    )


def gain_command(
    source: Source,
    output: Output,
    /,
    *,
    by: Annotated[str, Parameter(allow_leading_hyphen=True)],
    channels: Names = (),
    force: Force = False,
    json: Json = False,
) -> None:
    """Multiply a recording by a factor or a level in decibels.

    Parameters
    ----------
    by
        Factor, such as 2 or 0.5, or level change, such as 6dB.
    channels
        Change only these channels: numbers from 0, separated by commas.

    Examples
    --------
    $ midair gain take.h5 louder.h5 --by 6dB
    """
    may_write(output, force)
    recording = open_take(source, streamed=True).recording
    factor = _factor(by)
    factors = np.ones(recording.sensor.count)
    factors[list(_numbers(channels, recording)) or slice(None)] = factor
    made = recordings.gain(recording, factors.reshape(recording.sensor.shape) if channels else factor)
    _write(made, [source], output, json=json)


def mask_command(
    source: Source,
    output: Output,
    /,
    *,
    channels: Names,
    fill: recordings.Fill = "zero",
    force: Force = False,
    json: Json = False,
) -> None:
    """Set channels of a recording to zero, or interpolate them from their neighbours.

    Parameters
    ----------
    channels
        Channels to replace: numbers from 0, row by row, separated by commas.
    fill
        New value: zero, or the mean of the neighbours that are not masked.

    Examples
    --------
    $ midair mask take.h5 clean.h5 --channels 3,7 --fill neighbours
    """
    may_write(output, force)
    recording = open_take(source, streamed=True).recording
    _write(recordings.mask(recording, _numbers(channels, recording), fill=fill), [source], output, json=json)


def _write(recording: Recording, sources: list[Path], output: Path, *, json: bool) -> None:
    """Write an edited recording, with the calibration that all its sources share."""
    takes = [open_take(source, streamed=True) for source in sources]
    calibrations = [take.calibration for take in takes]
    calibration = calibrations[0] if _same(calibrations) else None
    notes: list[str] = []
    if calibration is None and any(calibrations):
        notes.append("The calibration was left out: the recordings have different calibrations.")
    if any(take.stored and "pressure" in contents(source).parts for take, source in zip(takes, sources, strict=True)):
        notes.append("The calibrated pressure was left out; run midair calibrate again.")
    # Before writing, which may replace the source.
    rows = [("recording", str(output)), *recording_rows(recording)]
    lost = save(recording, output, calibration=calibration)
    figures = {"recording": str(output), **recording_figures(recording)}
    print_written(rows, figures, notes, lost, simulated=recording.provenance.simulated, json=json)


def _same(calibrations: list[Calibration | None]) -> bool:
    """Whether all are present and have the same response."""
    first = calibrations[0]
    return first is not None and all(
        other is not None
        and np.array_equal(other.frequency, first.frequency)
        and np.array_equal(other.response, first.response)
        and other.unit == first.unit
        for other in calibrations
    )


def _numbers(names: tuple[str, ...], recording: Recording) -> tuple[int, ...]:
    count = recording.sensor.count
    wrong = [name for name in names if not name.isdecimal() or int(name) >= count]
    if wrong:
        raise InputError(f"channels: expected comma-separated numbers from 0 to {count - 1}, got {', '.join(wrong)}")
    return tuple(int(name) for name in names)


def _factor(text: str) -> float:
    """Factor that a number or a number of decibels means."""
    number, decibels = (text[:-2], True) if text.lower().endswith("db") else (text, False)
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or (decibels and abs(value) > 200):
        raise InputError(f"--by: expected a factor such as 2 or decibels such as 6dB, got {text!r}")
    return 10 ** (value / 20) if decibels else value
