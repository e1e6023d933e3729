"""Pressure of recordings from public data sets by name, for benchmarks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from midair.datasets import sample
from midair.files import open_take
from midair.model import Calibration, PressureFrames, Recording, SensorGrid
from midair.paper.modes_compared import strongest_part
from midair.pipeline import calibrated_pressure
from midair.recordings import Footprint, footprint_field
from midair.settings import Settings

_FOLDERS = [above / "shared" / "data" for above in Path(__file__).parents[1:]]
DATA = next((folder for folder in _FOLDERS if folder.is_dir()), _FOLDERS[0])
"""Folder with fabricslide, hapmat and audio-to-tactile."""
RATE = 1000.0
"""Rate in Hz to which recordings of a lower rate are sped up."""


def fast(recording: Recording) -> Recording:
    """The same frames at 1 kHz."""
    return replace(recording, rate=RATE)


def over_the_sensor(recording: Recording, sensor: SensorGrid | None = None) -> Recording:
    """Field of a waveform under a disc that moves back and forth over the cells, 4 x 4 if None."""
    return footprint_field(recording, Footprint(turn="back"), sensor=sensor)


def flat_30_pa(recording: Recording) -> Calibration:
    """The calibration that makes the largest change 30 Pa."""
    samples = np.asarray(recording.samples, float)
    change = float(np.abs(samples - np.median(samples, axis=0)).max())
    return Calibration.flat(recording.sensor, sensitivity=change / 30, unit=recording.unit)


def taxels(name: str) -> Recording:
    """A recording of sixteen taxels, at 1 kHz."""
    return fast(open_take(DATA / "fabricslide" / name).recording)


def stick(name: str, sensor: SensorGrid | None = None) -> Recording:
    """Acceleration of a stick on a surface, 10 times as fast, as a field."""
    wave = open_take(DATA / "hapmat" / f"{name} 1.csv", channels=["accel_z"], unit="count").recording
    return over_the_sensor(fast(wave), sensor)


def effect(name: str) -> Recording:
    """A designed effect as a field."""
    path = DATA / "audio-to-tactile" / f"tactile_pattern_{name}.wav"
    return over_the_sensor(open_take(path, unit="count").recording)


def _denim() -> Recording:
    # The taxels give 36 values per second, below the band; 570 values per second are a slide at .8 m/s.
    taxels = sample("denim")
    return replace(taxels, rate=16 * taxels.rate)


RECORDED: Mapping[str, Callable[[], Recording]] = {
    "linen": lambda: taxels("fabric/Linen_F180_V-50mmps_0.csv"),
    "grating of 2 mm": lambda: taxels("board/Board2mm_F135_V-30mmps_0.csv"),
    "stick on fabric": lambda: stick("Fabric"),
    "stick on metal": lambda: stick("Metal"),
    "stick on paper, 3 x 3 cells": lambda: stick("Paper", SensorGrid(rows=3, columns=3)),
    "connect": lambda: effect("connect"),
    "confirm": lambda: effect("confirm"),
}
"""Recordings of the data sets."""


def pressure(name: str, settings: Settings, seconds: float) -> PressureFrames | None:
    """Pressure at the rate and in the band of the settings, the strongest part; None for an unknown name."""
    if name == "denim":
        recording = _denim()
        slow = settings.but(band=(20.0, 250.0))
        return calibrated_pressure(recording, flat_30_pa(recording), slow).cut(0.1, seconds)
    if name not in RECORDED:
        return None
    recording = RECORDED[name]()
    return strongest_part(calibrated_pressure(recording, flat_30_pa(recording), settings), seconds)
