"""Print how many people feel touches of midair by its model: `python docs/felt_tables.py`.

Pressure that half of all people feel by frequency and area in each skin, then samples and patterns at their own level,
as if an array reproduced them exactly, with the level at an ear in air of an unknown temperature. SIMULATED, not tried
on people.
"""

from collections.abc import Iterable

import numpy as np

import midair
from midair.datasets import SAMPLES, sample
from midair.devices import measure_exposure
from midair.evaluate import Felt, felt
from midair.files import DEFAULT_PROFILE, load_profiles
from midair.model import Acoustics, Drive, Palm, TransducerArray
from midair.patterns import PALETTE, Pattern, draw, palm_pressure
from midair.physics import SKINS
from midair.pipeline import calibrated_pressure
from midair.settings import Settings

RATE, PITCH = 1000.0, 2e-3
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


def row(name: str, found: Felt, peak: float, drive: Drive) -> None:
    about, fewest, most = found.people
    ears = measure_exposure(drive, drive.array, load_profiles()[DEFAULT_PROFILE]).sound_excess
    people = f"{about} ({fewest} to {most})"
    print(f"| {name} | {peak:.0f} Pa | {found.level:+.0f} dB | {people} | {ears:+.0f} dB |", flush=True)


def touches(names: Iterable[str] = (*SAMPLES, *PALETTE)) -> None:
    """Samples and patterns at their own level."""
    print("\n| touch | peak | over the threshold | of 10 people | ears, over their limit |")
    array, palm = TransducerArray.autd3(), Palm.disc()
    for name in names:
        if name in PALETTE:
            pattern = Pattern.from_plain(PALETTE[name])
            foci = pattern.foci(min(pattern.duration_s or 1.0, 1.0))
            pressure, rate = palm_pressure(foci, array, palm, acoustics=Acoustics())
            drive = draw(foci, array).drive
            row(f"{name} *", felt(pressure, rate, palm.pitch), float(foci.pressure.max()), drive)
        elif (recording := sample(name)).unit == "Pa":
            cells = calibrated_pressure(recording, None, Settings())
            drive = midair.solve(midair.prepare(cells), array).drive
            row(name, felt(cells.pressure, cells.rate, cells.sensor.pitch), float(recording.samples.max()), drive)


if __name__ == "__main__":
    thresholds()
    touches()
