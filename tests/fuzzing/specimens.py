"""Sound files of every kind that midair reads, small, to be damaged."""

import json
from pathlib import Path

import numpy as np
import soundfile
from tests.foreign_files import tdms, xdf, xdf_whole

from midair.datasets import sample_path
from midair.files import RecordingWriter, save, save_sensor
from midair.model import (
    Calibration,
    Provenance,
    Recording,
    SensorGrid,
    SensorWiring,
)
from midair.settings import best_mode

GRID = SensorGrid(rows=2, columns=3, pitch=7e-3, name="palm µ")
RNG = np.random.default_rng(5)


def make_all(folder: Path) -> None:
    _own(folder)
    _sounds_and_tables(folder)
    _laboratories(folder)
    _written_by_hand(folder)
    _effects(folder)


def recording() -> Recording:
    life = Provenance(source="virtual:towel é", simulated=True, notes={"object": 'towel, "wet"\nµ'})
    life = life.then("record", {"band": (20.0, 470.0), "n": 3, "on": True, "none": None, "deep": ("a", (1, 2.5))})
    return Recording(samples=RNG.normal(size=(40, 2, 3)), rate=1000 / 3, sensor=GRID, unit="V", provenance=life)


def calibration() -> Calibration:
    return Calibration(
        sensor=GRID,
        frequency=np.array([0.0, 20.0, 470.0]),
        response=RNG.normal(size=(3, 2, 3)) + 1j * RNG.normal(size=(3, 2, 3)),
        noise=RNG.random((2, 3)),
        unit="V",
        date="2026-11-20",
        provenance=Provenance(source="bench"),
    )


def _own(folder: Path) -> None:
    take = recording()
    for ending in (".csv", ".wav", ".npz"):
        save(take, folder / f"own{ending}")
    # What a killed recorder leaves: the bytes while it still runs.
    with RecordingWriter(
        folder / "made.h5", rate=1000, sensor=GRID, unit="V", provenance=take.provenance, calibration=calibration()
    ) as writer:
        writer.append(take.samples)
        (folder / "killed.h5").write_bytes((folder / "made.h5").read_bytes())
    (folder / "made.h5").unlink()


def _sounds_and_tables(folder: Path) -> None:
    samples = recording().samples.reshape(40, 6)
    for name, form, subtype in (
        ("w64", "W64", "DOUBLE"),
        ("rf64", "RF64", "PCM_24"),
        ("wav", "WAV", "PCM_16"),
        ("ulaw.wav", "WAV", "ULAW"),
        ("float.wav", "WAVEX", "FLOAT"),
    ):
        soundfile.write(folder / f"foreign.{name}", np.clip(samples / 8, -1, 1), 1000, subtype=subtype, format=form)
    (folder / "denim.csv").write_bytes(b"\n".join(sample_path("denim").read_bytes().split(b"\n")[:30]))
    rows = "\n".join(f"{i / 100},{i % 7},{i % 5}" for i in range(40))
    (folder / "stamped.csv").write_text(f"time [s],a [V],b [V]\n{rows}\n")
    np.savez_compressed(folder / "foreign.npz", x=samples, y=np.arange(3), name=np.array("skin"))


def _laboratories(folder: Path) -> None:
    samples = recording().samples.reshape(40, 6)
    labels = [f"c{number}" for number in range(6)]
    (folder / "a.xdf").write_bytes(xdf_whole(xdf(samples, labels=labels, unit="volts")))
    columns = {f"mic {number}": column for number, column in enumerate(samples.T)}
    (folder / "a.tdms").write_bytes(tdms(columns) + tdms(columns, interleaved=True))


def _effects(folder: Path) -> None:
    """Effects with all that midair reads of them."""
    parameters = [
        {"ParameterID": name, "ParameterValue": value}
        for name, value in (
            ("HapticIntensity", 0.8),
            ("HapticSharpness", 0.4),
            ("AttackTime", 0.01),
            ("DecayTime", 0.05),
            ("ReleaseTime", 0.1),
            ("Sustained", 0.0),
        )
    ]
    curve = [{"Time": at, "ParameterValue": at} for at in (0.0, 0.2, 0.4)]
    pattern = [
        {"Event": {"Time": 0.1, "EventType": "HapticContinuous", "EventDuration": 0.5, "EventParameters": parameters}},
        {"Event": {"Time": 0.4, "EventType": "HapticTransient", "EventParameters": parameters[:2]}},
        {"Event": {"Time": 0.0, "EventType": "AudioCustom", "EventWaveformPath": "a.wav"}},
        {"Parameter": {"ParameterID": "HapticIntensityControl", "ParameterValue": 0.6, "Time": 0.2}},
        {
            "ParameterCurve": {
                "ParameterID": "HapticSharpnessControl",
                "Time": 0.1,
                "ParameterCurveControlPoints": curve,
            }
        },
    ]
    points = [{"time": at, "amplitude": at, "emphasis": {"amplitude": at, "frequency": at}} for at in (0.0, 0.2, 0.4)]
    envelopes = {"amplitude": points, "frequency": [{"time": at, "frequency": at} for at in (0.0, 0.4)]}
    (folder / "foreign.haptic").write_text(json.dumps({"signals": {"continuous": {"envelopes": envelopes}}}))
    (folder / "foreign.ahap").write_text(json.dumps({"Version": 1.0, "Pattern": pattern}))


def _written_by_hand(folder: Path) -> None:
    wiring = SensorWiring(grid=GRID, order=(5, 4, 3, 2, 1, 0), unit="V", full_scale=1.25, sensitivity=0.02)
    save_sensor(wiring, folder / "sensor.toml")
    units = "".join(f"[[unit]]\nposition_mm = [{x}, 0, 0]\nrotation_deg = [0, 0, {x}]\n" for x in (0, 200))
    (folder / "placement.toml").write_text(f'name = "two"\n{units}')
    place = (
        '[[profile.place]]\nname = "ear"\nposition_mm = [0, 0, 500]\nreach_mm = 10\nlimit_db = 110\nenforced = true\n'
    )
    words = 'name = "mine"\ntitle = "t"\nsource = "s"\nevidence = "e"\n'
    (folder / "exposure.toml").write_text(f"[[profile]]\n{words}{place}{place}")
    best_mode().save(folder / "settings.toml")
