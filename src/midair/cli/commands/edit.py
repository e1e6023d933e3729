"""Commands that edit recordings: cut, join, resample, trim, gain, fade, mask."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from midair import files, recordings
from midair.cli.import_options import ChannelNumbers, channel_numbers, resampled
from midair.cli.options import Force, Frequency, Json, OptionalTime, Output, Source, Time
from midair.cli.output import may_write, print_table, recording_text
from midair.errors import InputError
from midair.model import Recording
from midair.settings import MOST_GAIN
from midair.table import Row, describe


def cut_command(
    source: Source,
    output: Output,
    /,
    *,
    start: Time = 0.0,
    end: OptionalTime = None,
    duration: OptionalTime = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Extract a part of a recording.

    Parameters
    ----------
    start
        Start of the part.
    end
        End of the part. [default: end of the recording]
    duration
        Length of the part, in place of its end.

    Examples
    --------
    $ midair cut take.h5 part.h5 --start 0.4s --end 0.9s
    $ midair cut take.h5 part.h5 --start 0.4s --duration 0.5s
    """
    if duration is not None:
        if end is not None:
            raise InputError("cut: expected --end or --duration, got both")
        end = start + duration
    _edit([source], output, lambda takes: recordings.cut(takes[0], start, end), force=force, json=json)


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
    _edit(files[:-1], files[-1], recordings.join, force=force, json=json)


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
    _edit([source], output, lambda takes: resampled(takes[0], rate), force=force, json=json)


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
    _edit([source], output, lambda takes: recordings.trim(takes[0], share=share, margin=margin), force=force, json=json)


def gain_command(
    source: Source,
    output: Output,
    /,
    *,
    by: Annotated[str, Parameter(allow_leading_hyphen=True)],
    channels: ChannelNumbers = (),
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

    def louder(takes: list[Recording]) -> Recording:
        decibels = by.lower().endswith("db")
        try:
            value = float(by[:-2] if decibels else by)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or (decibels and abs(value) > 200):
            raise InputError(f"--by: expected a factor such as 2 or decibels such as 6dB, got {by!r}")
        factor = 10 ** (value / 20) if decibels else value
        if (factor <= 0 and factor != -1) or factor > MOST_GAIN:
            weaker = "" if factor >= 0 else f"; {by}dB weakens"
            raise InputError(f"--by: expected a factor other than 0, up to {MOST_GAIN:g} or 60dB, got {by}{weaker}")
        recording = takes[0]
        factors = np.ones(recording.sensor.count)
        factors[list(channel_numbers(channels, recording)) or slice(None)] = factor
        return recordings.gain(recording, factors.reshape(recording.sensor.shape) if channels else factor)

    _edit([source], output, louder, force=force, json=json)


def fade_command(
    source: Source, output: Output, /, *, start: Time = 0.05, end: Time = 0.05, force: Force = False, json: Json = False
) -> None:
    """Fade a recording in and out.

    Parameters
    ----------
    start
        Length of the fade in.
    end
        Length of the fade out.

    Examples
    --------
    $ midair fade take.h5 soft.h5 --start 0.1s
    """
    _edit([source], output, lambda takes: recordings.fade(takes[0], start, end), force=force, json=json)


def mask_command(
    source: Source,
    output: Output,
    /,
    *,
    channels: ChannelNumbers,
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

    def masked(takes: list[Recording]) -> Recording:
        return recordings.mask(takes[0], channel_numbers(channels, takes[0]), fill=fill)

    _edit([source], output, masked, force=force, json=json)


def _edit(
    sources: Sequence[Path], output: Path, change: Callable[[list[Recording]], Recording], *, force: bool, json: bool
) -> None:
    """Write what `change` makes of the recordings, with the calibration that all sources share."""
    may_write(output, force)
    takes = [files.open_take(source) for source in sources]
    recording = change([take.recording for take in takes])
    calibrations = [take.calibration for take in takes]
    same = len({each and each.identifier for each in calibrations}) == 1
    calibration = calibrations[0] if same else None
    notes: list[str] = []
    if calibration is None and any(calibrations):
        notes.append("The calibration was left out: the recordings have different calibrations.")
    if any(
        take.stored and "pressure" in files.contents(source).parts for take, source in zip(takes, sources, strict=True)
    ):
        notes.append("The calibrated pressure was left out; run midair calibrate again.")
    # Before writing, which may replace the source.
    table = [Row("file", str(output), key="recording"), *describe(recording)]
    lost = files.save(recording, output, calibration=calibration, force=True)
    how: Any = {"notes": notes, "lost": lost, "simulated": recording.provenance.simulated}
    print_table(table, answer=recording_text(recording), json=json, **how)
