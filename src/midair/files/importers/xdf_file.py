"""XDF, the format of LabRecorder for Lab Streaming Layer: one stream of numbers becomes a recording.

pyxdf synchronises clocks; its warnings become a part of the report. It does not remove jitter, because it would take
lost samples for jitter.
"""

import logging
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import Any

import numpy as np

from midair.errors import BrokenFileError, MismatchError, MissingExtraError
from midair.files.opened_take import Format, ImportedData, ImportOptions


def read_xdf(path: Path, given: ImportOptions) -> ImportedData:
    """Read the only numeric stream of an XDF, or the one named `field`."""
    try:
        from pyxdf import load_xdf
    except ImportError as wrong:
        raise MissingExtraError("XDF needs pyxdf; pip install 'midair[xdf]'") from wrong
    with _captured_log("pyxdf") as messages, path.open("rb") as file:
        streams, _ = load_xdf(file, synchronize_clocks=True, dejitter_timestamps=False)
    usable = [stream for stream in streams if isinstance(stream["time_series"], np.ndarray)]
    usable = [stream for stream in usable if len(stream["time_series"]) > 1]
    names = ", ".join(f"{_first(stream['info'], 'name')} ({len(stream['time_series'])})" for stream in streams)
    found = names or "none"
    if given.field is not None:
        usable = [stream for stream in usable if _first(stream["info"], "name") == given.field]
        if len(usable) != 1:
            raise MismatchError(f"expected one stream of numbers called {given.field!r}, got {found}")
    if len(usable) != 1:
        raise BrokenFileError(f"expected one stream of numbers, or its name as field, got {found}")
    stream = usable[0]
    info = stream["info"]
    channels, nominal = _channels(info), float(_first(info, "nominal_srate") or 0)
    return ImportedData(
        samples=np.asarray(stream["time_series"], np.float64),
        form="XDF",
        stamps=np.asarray(stream["time_stamps"], np.float64),
        nominal=nominal if 0 < nominal < np.inf else None,
        names=tuple(name for name, _ in channels),
        units=tuple(unit for _, unit in channels),
        notes={"stream": _first(info, "name"), "device": _first(info, "source_id")},
        settings={"stream": _first(info, "name"), "nominal_hz": _first(info, "nominal_srate")},
        report=tuple(dict.fromkeys(f"pyxdf: {one.getMessage().splitlines()[0][:160]}" for one in messages)),
    )


def _channels(info: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Name and unit of each channel; empty if the description does not list all."""
    listed = [
        (_first(channel, "label"), _first(channel, "unit"))
        for described in info.get("desc") or []
        for part in (described or {}).get("channels") or []
        for channel in (part or {}).get("channel") or []
    ]
    return listed if len(listed) == int(_first(info, "channel_count") or 0) else []


def _first(info: Mapping[str, Any], name: str) -> str:
    """First item of an XML element, which pyxdf returns as a list."""
    value = info.get(name)
    value = value[0] if isinstance(value, list) and value else value
    return value if isinstance(value, str) else ""


@contextmanager
def _captured_log(name: str) -> Generator[list[logging.LogRecord]]:
    """Collect the warnings and errors of a logger instead of printing them."""
    logger, collector = logging.getLogger(name), BufferingHandler(1_000_000)
    collector.setLevel(logging.WARNING)
    spreads, logger.propagate = logger.propagate, False
    logger.addHandler(collector)
    try:
        yield collector.buffer
    finally:
        logger.removeHandler(collector)
        logger.propagate = spreads


XDF = Format(name="XDF", read=read_xdf, memory=3)
