"""A tone of known frequency, level and unit, in files of every reader with stamps of twelve kinds: right or refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from tests import foreign_files

from midair.errors import InputError
from midair.files import FORMATS, open_take, save
from midair.files.opened_take import ONE
from midair.model import Recording

ROWS = 1000
EPOCH = 1_696_000_000
EVERY = np.arange(ROWS)


def _exact(time, rng):
    return time


CLOCKS = {
    "s": (1000, "time [s]", 0, 1, _exact, EVERY),
    "ms": (700, "time_ms", 0, 1e-3, lambda time, rng: np.floor(1e3 * time) / 1e3, EVERY),
    "ms of a faster sensor": (4000, "time_ms", 5, 1e-3, lambda time, rng: np.floor(1e3 * time + 1e-6) / 1e3, EVERY),
    "date in us": (1000, "timestamp", EPOCH * 1e6, 1e-6, _exact, EVERY),
    "date in ns": (1000, "time", EPOCH * 1e9, 1e-9, _exact, EVERY),
    "six digits": (1000, "t", 1234, 1, lambda time, rng: np.floor(100 * time + 1e-6) / 100, EVERY),
    "packets": (1000, "time", 0, 1, lambda time, rng: np.repeat(time[::10] + 5e-4 * rng.random(100), 10), EVERY),
    "jitter": (1000, "time", 0, 1, _exact, EVERY),
    "lost rows": (1000, "time", 0, 1, _exact, np.delete(EVERY, slice(700, 712))),
    "a long gap": (1000, "time", 0, 1, _exact, np.delete(EVERY, slice(700, 740))),
    "counts of unknown size": (1000, "time", 0, 1e-3, _exact, EVERY),
    "copies": (1000, "time", 0, 1, _exact, np.repeat(EVERY, 2)),
}
"""Rate, column of the stamps, their first number, their unit in s, the stamps (s) of rows, and the rows in the file."""
REFUSED = {"a long gap", "counts of unknown size", "copies"}
UNITS = {"V": ("V", 1), "mV": ("V", 1e-3), "microvolts": ("V", 1e-6), "kPa": ("Pa", 1e3), "N": ("", 1)}


def _csv(path, stamps, wave, unit, clock, share):
    _, name, first, step, *_ = CLOCKS[clock]
    rows = zip(np.round(first + stamps / step, 6).tolist(), wave.tolist(), strict=True)
    path.write_text(f"{name},force [{unit}]\n" + "".join(f"{time!r},{number!r}\n" for time, number in rows))


def _tdms(path, stamps, wave, unit, clock, share):
    _, name, first, step, *_ = CLOCKS[clock]
    columns = {name: np.round(first + stamps / step, 6), "force": wave}
    path.write_bytes(foreign_files.tdms(columns, each={"force": {"unit_string": unit}}, said={}))


def _xdf(path, stamps, wave, unit, clock, share):
    data = foreign_files.xdf(wave[:, None], rate=CLOCKS[clock][0], stamps=100 + stamps, labels=["force"], unit=unit)
    path.write_bytes(foreign_files.xdf_whole(data))


def _sound(path, stamps, wave, unit, clock, share):
    """Half of full scale, as recorders write it; lossy encoders take no 1 kHz."""
    subtype = {".wav": "DOUBLE", ".rf64": "FLOAT", ".flac": "PCM_24", ".aiff": "PCM_16"}.get(path.suffix)
    rate, frames = (1000, ROWS) if subtype else (8000, 20 * ROWS)
    half = 0.5 * np.sin(2 * np.pi * share * np.arange(frames))
    pytest.importorskip("soundfile").write(path, half, rate, subtype=subtype, format=path.suffix[1:].upper())
    return share * rate, 0.5


def _arrays(path, stamps, wave, unit, clock, share):
    _, name, first, step, *_ = CLOCKS[clock]
    arrays = {name.replace(" [s]", "_s"): np.round(first + stamps / step, 6), "data": wave, "unit": unit}
    if path.suffix == ".mat":
        savemat(path, arrays)
    else:
        np.savez(path, **arrays)


def _npy(path, stamps, wave, unit, clock, share):
    np.save(path, wave)


def _lvm(path, stamps, wave, unit, clock, share):
    head = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nChannels\t1\t\n"
    head += f"Y_Unit_Label\t{unit}\t\nDelta_X\t1.0E-3\t\n***End_of_Header***\t\t\nX_Value\tForce\tComment\n"
    path.write_text(
        head + "".join(f"{time:.6f}\t{number!r}\n" for time, number in zip(stamps, wave.tolist(), strict=True))
    )


def _hatt(path, stamps, wave, unit, clock, share):
    numbers = " ".join(map(repr, wave.tolist()))
    path.write_text(f"<Texture><SampleRate>1000</SampleRate><Accel>{numbers}</Accel></Texture>")


def _effect(path, stamps, wave, unit, clock, share):
    """Half intensity at the middle of 80 to 230 Hz."""
    parameters = [("HapticIntensity", 0.5), ("HapticSharpness", 0.5)]
    named = [{"ParameterID": name, "ParameterValue": value} for name, value in parameters]
    event = {"Time": 0, "EventType": "HapticContinuous", "EventDuration": 1, "EventParameters": named}
    points = {"amplitude": [{"time": time, "amplitude": 0.5} for time in (0, 1)]}
    clip = {"signals": {"continuous": {"envelopes": points}}}
    path.write_text(json.dumps({"Pattern": [{"Event": event}]} if path.suffix == ".ahap" else clip))
    return 155, 0.5


def _own(path, stamps, wave, unit, clock, share):
    save(Recording(samples=wave[:, None, None], sensor=ONE, rate=CLOCKS[clock][0], unit="V"), path)


READERS = {
    **dict.fromkeys(["a.csv", "a.txt"], _csv),
    **dict.fromkeys(["a.wav", "a.rf64", "a.flac", "a.aiff", "a.ogg", "a.mp3"], _sound),
    **dict.fromkeys(["a.ahap", "a.haptic"], _effect),
    **{"a.tdms": _tdms, "a.xdf": _xdf, "a.npz": _arrays, "a.mat": _arrays, "a.npy": _npy, "a.lvm": _lvm},
    **{"a.xml": _hatt, "a.h5": _own},
}
"""How another program writes a tone; a writer returns the tone in Hz and the level where they are others."""
STAMPED = {"a.csv", "a.txt", "a.tdms", "a.xdf", "a.npz", "a.mat"}
WITHOUT_UNIT = READERS.keys() - STAMPED - {"a.lvm", "a.h5"}


def test_every_reader_has_a_tone():
    """A new format without one fails here."""
    assert {FORMATS[Path(file).suffix].name for file in READERS} == {FORMATS[ending].name for ending in FORMATS}


def read(folder, file, clock, written, *, share=0.1, level=0.5, seed=0, **given):
    """Frequency and level of the tone in a file, relative to the true ones, and the unit that was read."""
    clock = clock if file in STAMPED else "s"
    rng = np.random.default_rng(seed)
    rate, _, _, _, stamp, rows = CLOCKS[clock]
    time = EVERY / rate
    time = time + (rng.uniform(0, 0.5, ROWS) / rate if clock == "jitter" else 0)
    wave = level * np.sin(2 * np.pi * share * rate * time)
    made = READERS[file](folder / file, stamp(time, rng)[rows], wave[rows], written, clock, share)
    true, level = made or (share * rate, level)
    given |= {"rate": rate} if file == "a.npy" else {}
    seen = open_take(folder / file, **given).recording
    samples, times = np.asarray(seen.samples).ravel(), np.arange(seen.frames) / seen.rate
    spectrum = np.abs(np.fft.rfft((samples - samples.mean()) * np.hanning(len(samples)), 2**17))
    tone = spectrum.argmax() * seen.rate / 2**17
    wave = np.column_stack([np.cos(2 * np.pi * tone * times), np.sin(2 * np.pi * tone * times), times**0])
    return tone / true, np.hypot(*np.linalg.lstsq(wave, samples)[0][:2]) / level, seen.unit


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tones")


@settings(max_examples=120)
@given(
    file=st.sampled_from(list(READERS)),
    clock=st.sampled_from(list(CLOCKS)),
    unit=st.sampled_from(list(UNITS)),
    stated=st.sampled_from([{}, {}, {"unit": "V"}, {"unit": "Pa"}, {"scale": 2.0}]),
    share=st.floats(0.02, 0.2),
    level=st.floats(0.01, 100),
    seed=st.integers(0, 1000),
)
def test_a_known_tone_comes_back_or_the_file_is_refused(file, clock, unit, stated, share, level, seed, folder):
    """Before, 180 Hz came back as 20 Hz, 100 Hz as 94.3 Hz, and 1 mV as 1 V."""
    true, factor = UNITS[unit]
    try:
        tone, size, read_unit = read(folder, file, clock, unit, share=share, level=level, seed=seed, **stated)
    except InputError:
        return
    if file in WITHOUT_UNIT or file == "a.h5":
        true, factor = stated.get("unit", "V" if file == "a.h5" else ""), 1
    if "scale" in stated:
        true, factor = "Pa", 2
    assert read_unit == true
    assert tone == pytest.approx(1, abs=2e-3)
    assert size == pytest.approx(factor, rel=0.03)


@pytest.mark.parametrize("file", READERS)
def test_every_reader_reads_its_tone(file, folder):
    """What the file does not state is given; the property alone could refuse all."""
    stated = {"unit": "Pa"} if file in WITHOUT_UNIT else {}
    tone, size, unit = read(folder, file, "s", "V", **stated)
    assert (tone, size, unit) == (pytest.approx(1, abs=2e-3), pytest.approx(1, rel=0.03), stated.get("unit", "V"))


@pytest.mark.parametrize("file", ["a.csv", "a.tdms", "a.xdf", "a.npz", "a.mat"])
def test_nine_of_twelve_clocks_are_read(file, tmp_path):
    """A stream of XDF with a rate needs no unit of its stamps."""
    refused = REFUSED - ({"counts of unknown size"} if file == "a.xdf" else set())
    for clock in CLOCKS.keys() - refused:
        for said in {}, {"rate": CLOCKS[clock][0]}:
            tone, size, unit = read(tmp_path, file, clock, "mV", **said)
            assert (tone, size, unit) == (pytest.approx(1, abs=2e-3), pytest.approx(1e-3, rel=0.03), "V")
    for clock in refused:
        with pytest.raises(InputError, match=r"gaps|in the name of column|rows repeat stamp"):
            read(tmp_path, file, clock, "mV")
