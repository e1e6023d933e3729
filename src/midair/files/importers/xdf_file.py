"""XDF, the format of LabRecorder for Lab Streaming Layer: one stream of numbers becomes a recording.

pyxdf synchronises clocks and removes jitter; its warnings become a part of the report.
"""

import logging
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import BrokenFileError, MismatchError, MissingExtraError
from midair.files.importers.header import known_unit
from midair.files.opened_take import Format, ImportedData, ImportOptions, OpenedTake
from midair.files.timestamps import to_fixed_rate
from midair.model import Unit


def read_xdf(path: Path, given: ImportOptions) -> OpenedTake:
    """Read the only numeric stream of an XDF, or the one named `stream`."""
    try:
        from pyxdf import load_xdf
    except ImportError as wrong:
        raise MissingExtraError(f"{path}: XDF needs pyxdf; pip install 'midair[xdf]'") from wrong
    with _captured_log("pyxdf") as messages, path.open("rb") as file:
        streams, _ = load_xdf(file, synchronize_clocks=True, dejitter_timestamps=True)
    usable = [stream for stream in streams if isinstance(stream["time_series"], np.ndarray)]
    usable = [stream for stream in usable if len(stream["time_series"]) > 1]
    names = ", ".join(f"{_first(stream['info'], 'name')} ({len(stream['time_series'])})" for stream in streams)
    found = names or "none"
    if given.stream is not None:
        usable = [stream for stream in usable if _first(stream["info"], "name") == given.stream]
        if len(usable) != 1:
            raise MismatchError(f"{path}: expected one stream of numbers called {given.stream!r}, got {found}")
    if len(usable) != 1:
        raise BrokenFileError(f"{path}: expected one stream of numbers, or its name as stream, got {found}")
    stream = usable[0]
    info = stream["info"]
    channels = _channels(info)
    scale = np.array([1.0 if given.scale else factor for _, _, factor in channels] or [1.0])
    samples = np.asarray(stream["time_series"], np.float64)
    stamps = np.asarray(stream["time_stamps"], np.float64)
    even = to_fixed_rate(stamps, samples * scale, rate=given.rate)
    return ImportedData(
        samples=even.samples,
        form="XDF",
        rate=even.rate,
        names=tuple(name for name, _, _ in channels),
        units=tuple(unit for _, unit, _ in channels),
        notes={"stream": _first(info, "name"), "device": _first(info, "source_id")},
        settings={"stream": _first(info, "name"), "rate_hz": even.rate, "nominal_hz": _first(info, "nominal_srate")},
        report=(*(f"pyxdf: {sentence}" for sentence in dict.fromkeys(messages)), *even.report),
    ).resolve(given, path)


def _channels(info: Mapping[str, Any]) -> list[tuple[str, Unit | None, float]]:
    """Name, unit and factor of each channel; empty if the description does not list all."""
    listed: list[tuple[str, Unit | None, float]] = []
    for described in info.get("desc") or []:
        for part in (described or {}).get("channels") or []:
            for channel in (part or {}).get("channel") or []:
                unit, factor = known_unit(_first(channel, "unit"))
                listed.append((_first(channel, "label"), unit, factor))
    return listed if len(listed) == int(_first(info, "channel_count") or 0) else []


def _first(info: Mapping[str, Any], name: str) -> str:
    """First item of an XML element, which pyxdf returns as a list."""
    value = info.get(name)
    value = value[0] if isinstance(value, list) and value else value
    return value if isinstance(value, str) else ""


@contextmanager
def _captured_log(name: str) -> Generator[list[str]]:
    """Collect the warnings and errors of a logger instead of printing them."""
    messages: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            messages.append(record.getMessage().splitlines()[0][:160])

    logger, collector = logging.getLogger(name), Collector(logging.WARNING)
    spreads, logger.propagate = logger.propagate, False
    logger.addHandler(collector)
    try:
        yield messages
    finally:
        logger.removeHandler(collector)
        logger.propagate = spreads


XDF = Format(name="XDF", read=read_xdf, memory=3)
