"""Damaged files of every kind that midair imports: a value or one line, never a traceback or a crash."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.foreign_files import tdms, xdf, xdf_whole

from midair.datasets import sample_path
from midair.errors import MidairError
from midair.files import RecordingWriter, load_placement, load_profiles, load_sensor, open_take, save, save_sensor
from midair.model import Provenance, Recording, SensorGrid, SensorWiring
from midair.settings import Settings, best_mode

GRID = SensorGrid(rows=2, columns=3, pitch=7e-3, name="palm µ")

NUMBERS = (0, 1, 2, 3, 7, 16, 127, 255, 256, 32767, 65535, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 8)
WORDS = ("", "nan", "inf", "1e400", "-1", "0", "1e17", "99999999999", "null", "true", "[]", "{}", "x" * 70_000, "ä\0")


def specimens(folder: Path) -> None:
    """Write one small file of each kind."""
    samples = np.random.default_rng(5).normal(size=(40, 2, 3))
    life = Provenance(source="virtual:towel é", simulated=True, notes={"object": 'towel, "wet"\nµ'})
    take = Recording(samples=samples, rate=1000 / 3, sensor=GRID, unit="V", provenance=life)
    for ending in (".csv", ".wav", ".npz"):
        save(take, folder / f"own{ending}")
    # What a killed recorder leaves: the bytes while it still runs.
    with RecordingWriter(folder / "made.h5", rate=1000, sensor=GRID, unit="V", provenance=life) as writer:
        writer.append(samples)
        (folder / "killed.h5").write_bytes((folder / "made.h5").read_bytes())
    flat = samples.reshape(40, 6)
    for name, form, subtype in (("rf64", "RF64", "PCM_24"), ("wav", "WAV", "ULAW")):
        soundfile.write(folder / f"foreign.{name}", np.clip(flat / 8, -1, 1), 1000, subtype=subtype, format=form)
    (folder / "denim.csv").write_bytes(b"\n".join(sample_path("denim").read_bytes().split(b"\n")[:30]))
    np.savez_compressed(folder / "foreign.npz", x=flat, y=np.arange(3), name=np.array("skin"))
    (folder / "a.xdf").write_bytes(xdf_whole(xdf(flat, labels=[f"c{number}" for number in range(6)], unit="volts")))
    (folder / "a.tdms").write_bytes(tdms({f"mic {number}": column for number, column in enumerate(flat.T)}))
    at = [{"time": each, "amplitude": each, "frequency": each} for each in (0.0, 0.2, 0.4)]
    envelopes = {"amplitude": at, "frequency": at}
    (folder / "foreign.haptic").write_text(json.dumps({"signals": {"continuous": {"envelopes": envelopes}}}))
    event = {"Time": 0.1, "EventType": "HapticContinuous", "EventDuration": 0.5, "EventParameters": []}
    (folder / "foreign.ahap").write_text(json.dumps({"Version": 1.0, "Pattern": [{"Event": event}]}))
    wiring = SensorWiring(grid=GRID, order=(5, 4, 3, 2, 1, 0), unit="V", full_scale=1.25, sensitivity=0.02)
    save_sensor(wiring, folder / "sensor.toml")
    (folder / "placement.toml").write_text('name = "one"\n[[unit]]\nposition_mm = [0, 0, 0]\n')
    words = 'name = "mine"\ntitle = "t"\nsource = "s"\nevidence = "e"\n[[profile.place]]\nname = "ear"\n'
    words += "position_mm = [0, 0, 500]\nreach_mm = 10\nlimit_db = 110\nenforced = true\n"
    (folder / "exposure.toml").write_text(f"[[profile]]\n{words}")
    best_mode().save(folder / "settings.toml")


def foreign(path: Path) -> None:
    """Open a file of another program with what it may not state."""
    one = SensorGrid(rows=1, columns=1) if path.suffix in (".haptic", ".ahap") else GRID
    states_rate = path.suffix in (".haptic", ".ahap", ".xdf", ".tdms")
    open_take(path, unit="V", sensor=one, **({} if states_rate else {"rate": 1000}))


READERS: dict[str, Callable[[Path], object]] = {
    **dict.fromkeys(("own.csv", "own.wav", "own.npz", "killed.h5", "denim.csv"), open_take),
    **dict.fromkeys((f"foreign.{end}" for end in ("rf64", "wav", "npz", "haptic", "ahap")), foreign),
    "a.xdf": foreign,
    "a.tdms": foreign,
    "sensor.toml": load_sensor,
    "placement.toml": load_placement,
    "exposure.toml": load_profiles,
    "settings.toml": Settings.load,
}
"""What reads each specimen."""


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Data with changed bits, numbers or words, with a part left out or doubled, or with its end cut."""
    spoilt = bytearray(data)
    first, last = sorted(int(place) for place in rng.integers(len(data), size=2))
    match int(rng.integers(8)):
        case 0:
            del spoilt[first:]
        case 1:
            del spoilt[first : min(last, first + 64)]
        case 2:
            spoilt[first:last] = spoilt[first:last] * 2
        case 3:
            for place in rng.integers(len(data), size=rng.integers(1, 9)):
                spoilt[place] ^= 1 << int(rng.integers(8))
        case 4 | 5:
            # Lengths, counts and types stand in the first part, at multiples of two.
            for place in 2 * rng.integers(min(len(data), 512) // 2, size=rng.integers(1, 4)):
                size = int(rng.choice([1, 2, 4, 8]))
                spoilt[place : place + size] = (int(rng.choice(NUMBERS)) % 2 ** (8 * size)).to_bytes(size, "little")
        case _:
            for _ in range(int(rng.integers(1, 4))):
                words = list(re.finditer(rb"[\w.+-]+", bytes(spoilt)))
                start, end = words[int(rng.integers(len(words)))].span() if words else (0, 0)
                spoilt[start:end] = WORDS[int(rng.integers(len(WORDS)))].encode()
    return bytes(spoilt)


@pytest.fixture
def limited():
    """At most 4 GiB more than now, as a container has: a damaged length takes no more."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (4 * 2**30, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_DATA, before)


@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("count", [100, pytest.param(10_000, marks=pytest.mark.slow)])
def test_damaged_files_are_read_or_refused_in_one_line(count, tmp_path, limited):
    pytest.importorskip("pyxdf")
    specimens(tmp_path)
    contents = {name: (tmp_path / name).read_bytes() for name in READERS}
    read, refused = 0, 0
    for number in range(count):
        name = list(READERS)[number % len(READERS)]
        (tmp_path / name).write_bytes(damaged(contents[name], np.random.default_rng((1, number))))
        try:
            READERS[name](tmp_path / name)
            read += 1
        except MidairError as wrong:
            assert "\n" not in str(wrong)
            refused += 1
    assert refused > count / 4, "most damage is noticed"
    assert read > count / 20, "some is not, and read for what it says"
