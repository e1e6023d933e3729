"""Print how many people feel touches of midair by its model: `python docs/felt_tables.py [FILE.csv ...]`.

Pressure that half of all people feel by frequency and area in each skin, then samples, patterns and files as if an
array reproduced them exactly: at their own level, in the mode quiet under levels at the ears, and attenuated behind ear
protection; with the level at an ear in air of an unknown temperature. Files are sped up to 1 kHz, with a largest change
of 30 Pa. The mode quiet solves recordings for its gain; patterns have no such mode and are attenuated to the level.
SIMULATED, not tried on people.
"""

import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

import midair
from midair.datasets import SAMPLES, sample
from midair.devices import measure_exposure
from midair.evaluate import Felt, felt
from midair.files import DEFAULT_PROFILE, load_profiles
from midair.model import Acoustics, Calibration, Medium, Palm, PressureFrames, TransducerArray
from midair.patterns import PALETTE, Pattern, draw, palm_pressure
from midair.physics import SKINS
from midair.pipeline import calibrated_pressure, required_lead, with_fitted_gain
from midair.settings import Settings, quiet_mode
from midair.targets import add_lead

RATE, PITCH = 1000.0, 2e-3
LEVELS = (110.0, 115.0, 120.0, 130.0)
"""At most in dB at the ears, in the mode quiet; a protection of 20 dB permits 130 dB."""
PROTECTIONS = (20, 31)
"""Ear protection in dB, behind which a touch is attenuated no more than it must be."""
PLACE = PITCH * np.arange(-7, 8)


def thresholds() -> None:
    """Peak pressure of a vibration on a disc that half of all people feel."""
    print("| Hz | cm2 |" + "".join(f" {name}, Pa |" for name in SKINS))
    for area in (2.9e-4, 1.8e-4, 0.785e-4):
        inside = PLACE**2 + PLACE[:, None] ** 2 < area / np.pi
        disc = inside * area / (inside.sum() * PITCH**2)
        for frequency in (30, 60, 125, 200, 250, 400):
            wave = np.sin(2 * np.pi * frequency * np.arange(400) / RATE)[:, None, None]
            levels = felt(wave * disc, RATE, PITCH).levels.values()
            cells = "".join(f" {10 ** (-level / 20):.2g} |" for level in levels)
            print(f"| {frequency} | {1e4 * area:.2g} |{cells}", flush=True)


def row(name: str, found: Felt, peak: float, excess: float, quiet: Iterable[Felt]) -> None:
    protected = (found.at(-2 * max(excess - less, 0)) for less in PROTECTIONS)
    people = ("{} ({} to {})".format(*each.people) if each.people[2] else "0" for each in (found, *quiet, *protected))
    print(f"| {name} | {peak:.0f} Pa | {excess:+.0f} dB | {' | '.join(people)} |", flush=True)


def calibrated(name: str) -> tuple[float, PressureFrames]:
    """Peak in Pa and pressure of a sample, or of a file in counts."""
    if name in SAMPLES:
        recording, calibration = sample(name), None
        peak = float(recording.samples.max())
    else:
        recording = replace(midair.open_take(name).recording, rate=RATE)
        samples, peak = np.asarray(recording.samples, float), 30.0
        change = float(np.abs(samples - np.median(samples, axis=0)).max())
        calibration = Calibration.flat(recording.sensor, sensitivity=change / peak, unit=recording.unit)
    return peak, calibrated_pressure(recording, calibration, Settings())


def touches(names: Iterable[str] = (*SAMPLES, *PALETTE), levels: Iterable[float] = LEVELS) -> None:
    """Samples, patterns and files at their own level, under levels at the ears in dB, and behind protection."""
    ways = (
        "own level",
        *(f"quiet, {level:g} dB" for level in levels),
        *(f"protection {each} dB" for each in PROTECTIONS),
    )
    print("\n| touch | peak | ears, over their limit | " + " | ".join(ways) + " |")
    array, palm, profile = TransducerArray.autd3(), Palm.disc(), load_profiles()[DEFAULT_PROFILE]
    for name in names:
        if name in PALETTE:
            pattern = Pattern.from_plain(PALETTE[name])
            foci = pattern.foci(min(pattern.duration_s or 1.0, 1.0))
            pressure, rate = palm_pressure(foci, array, palm, acoustics=Acoustics(medium=Medium.at()))
            found, peak = felt(pressure, rate, palm.pitch), float(foci.pressure.max())
            excess = measure_exposure(draw(foci, array).drive, array, profile).sound_excess
            above = [excess + 110 - level for level in levels]
            row(f"{name} *", found, peak, excess, [found.at(-2 * max(each, 0)) for each in above])
        elif name not in SAMPLES or sample(name).unit == "Pa":
            peak, cells = calibrated(name)
            found = felt(cells.pressure, cells.rate, cells.sensor.pitch)
            excess = measure_exposure(midair.solve(midair.prepare(cells), array).drive, array, profile).sound_excess
            asked = add_lead(cells, required_lead(mode := quiet_mode()))
            fitted = (with_fitted_gain(asked, array, mode.but(ears=level)).target.gain for level in levels)
            row(Path(name).stem, found, peak, excess, (found.at(20 * np.log10(gain)) for gain in fitted))


if __name__ == "__main__":
    thresholds()
    touches((*SAMPLES, *PALETTE, *sys.argv[1:]))
