import numpy as np
import pytest

from midair.errors import FileError
from midair.files import RecordingWriter, load_played, open_take
from midair.model import Provenance, SensorGrid, TransducerArray

ARRAY = TransducerArray.autd3(columns=1, rows=1)
SENSOR = SensorGrid(rows=2, columns=3)


def beside(frames, seed):
    rng = np.random.default_rng(seed)
    return {
        "phase_steps": rng.integers(0, 256, (frames, ARRAY.count), np.uint8),
        "intensity": rng.integers(0, 256, frames, np.uint8),
        "instant": rng.integers(0, 2**60, frames, np.int64),
        "state": rng.integers(0, 7, frames, np.int8),
    }


def writer(path, **changes):
    known = {"rate": 1000.0, "sensor": SENSOR, "unit": "V", "provenance": Provenance(source="skin", simulated=True)}
    return RecordingWriter(path, **known, array=ARRAY, **changes)


def written(path, *, blocks=(5, 300, 1)):
    parts = [beside(frames, seed) for seed, frames in enumerate(blocks)]
    with writer(path) as file:
        for part in parts:
            file.append(np.random.default_rng(9).standard_normal((len(part["state"]), 2, 3)), part)
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def check(path, wanted):
    played = load_played(path)
    for name, values in wanted.items():
        assert np.array_equal(getattr(played, name), values), name
    assert played.array.same_as(ARRAY)
    assert (played.rate, played.provenance.simulated) == (1000.0, True)
    assert open_take(path).recording.frames == len(wanted["state"])


def test_played_values_are_read_back_bit_by_bit(tmp_path):
    wanted = written(tmp_path / "take.h5")
    check(tmp_path / "take.h5", wanted)


def test_frames_need_played_values_only_with_an_array(tmp_path):
    known = {"rate": 1000.0, "sensor": SENSOR, "unit": "V", "provenance": Provenance()}
    with RecordingWriter(tmp_path / "plain.h5", **known) as file:
        file.append(np.ones((4, 2, 3)))
        with pytest.raises(FileError, match="without the values played"):
            file.append(np.ones((4, 2, 3)), beside(4, 1))
    assert load_played(tmp_path / "plain.h5") is None
    with writer(tmp_path / "take.h5") as file, pytest.raises(FileError, match="with the values played"):
        file.append(np.ones((4, 2, 3)))
