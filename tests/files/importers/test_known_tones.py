"""A tone of known frequency, level and unit, in files of every reader with stamps of twelve kinds: right or refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from tests import foreign_files

from midair.errors import InputError
from midair.files import open_take

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


def _csv(path, stamps, wave, unit, clock):
    _, name, first, step, *_ = CLOCKS[clock]
    rows = zip(np.round(first + stamps / step, 6).tolist(), wave.tolist(), strict=True)
    path.write_text(f"{name},force [{unit}]\n" + "".join(f"{time!r},{number!r}\n" for time, number in rows))


def _tdms(path, stamps, wave, unit, clock):
    _, name, first, step, *_ = CLOCKS[clock]
    columns = {name: np.round(first + stamps / step, 6), "force": wave}
    path.write_bytes(foreign_files.tdms(columns, each={"force": {"unit_string": unit}}, said={}))


def _xdf(path, stamps, wave, unit, clock):
    data = foreign_files.xdf(wave[:, None], rate=CLOCKS[clock][0], stamps=100 + stamps, labels=["force"], unit=unit)
    path.write_bytes(foreign_files.xdf_whole(data))


def _wav(path, stamps, wave, unit, clock):
    pytest.importorskip("soundfile").write(path, wave, CLOCKS[clock][0], subtype="DOUBLE")


def _arrays(path, stamps, wave, unit, clock):
    _, name, first, step, *_ = CLOCKS[clock]
    arrays = {name.replace(" [s]", "_s"): np.round(first + stamps / step, 6), "data": wave, "unit": unit}
    if path.suffix == ".mat":
        savemat(path, arrays)
    else:
        np.savez(path, **arrays)


READERS = {"a.csv": _csv, "a.tdms": _tdms, "a.xdf": _xdf, "a.wav": _wav, "a.npz": _arrays, "a.mat": _arrays}


def read(folder, file, clock, written, *, share=0.1, level=0.5, seed=0, **given):
    """Frequency and level of the tone in a file, relative to the true ones, and the unit that was read."""
    clock = "s" if file == "a.wav" else clock
    rng = np.random.default_rng(seed)
    rate, _, _, _, stamp, rows = CLOCKS[clock]
    time = EVERY / rate
    time = time + (rng.uniform(0, 0.5, ROWS) / rate if clock == "jitter" else 0)
    wave = level * np.sin(2 * np.pi * share * rate * time)
    READERS[file](folder / file, stamp(time, rng)[rows], wave[rows], written, clock)
    seen = open_take(folder / file, **given).recording
    samples, times = np.asarray(seen.samples).ravel(), np.arange(seen.frames) / seen.rate
    spectrum = np.abs(np.fft.rfft((samples - samples.mean()) * np.hanning(len(samples)), 2**17))
    tone = spectrum.argmax() * seen.rate / 2**17
    wave = np.column_stack([np.cos(2 * np.pi * tone * times), np.sin(2 * np.pi * tone * times), times**0])
    return tone / (share * rate), np.hypot(*np.linalg.lstsq(wave, samples)[0][:2]) / level, seen.unit


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tones")


@settings(max_examples=60)
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
    if file == "a.wav":
        true, factor = stated.get("unit", ""), 1
    if "scale" in stated:
        true, factor = "Pa", 2
    assert read_unit == true
    assert tone == pytest.approx(1, abs=2e-3)
    assert size == pytest.approx(factor, rel=0.03)


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
