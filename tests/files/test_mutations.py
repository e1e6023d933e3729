import struct

import numpy as np
import pytest
import soundfile
from scipy.io import savemat
from tests.fuzzing.damage import bytes_anywhere

from midair.datasets.catalogue import sample_path
from midair.errors import MidairError
from midair.files import (
    load,
    load_calibration,
    load_pressure,
    load_solution,
    load_target,
    save,
    save_calibration,
    save_pressure,
    save_solution,
)
from midair.model import PressureFrames, SensorGrid


@pytest.fixture(scope="module")
def originals(recording, calibration, solution, target, xdf, tdms, mcap, tmp_path_factory):
    folder = tmp_path_factory.mktemp("originals")
    for ending in (".h5", ".csv", ".wav", ".npz", ".mat", ".nc"):
        save(recording, folder / f"a{ending}", calibration=calibration if ending in (".h5", ".nc") else None)
    save_pressure(PressureFrames(pressure=recording.samples, rate=333, sensor=recording.sensor), folder / "a.h5")
    save_calibration(calibration, folder / "a.calibration.h5")
    save_solution(solution, folder / "a.drive.h5", target=target)
    (folder / "foreign.csv").write_bytes(b"\n".join(sample_path("denim").read_bytes().split(b"\n")[:30]))
    samples = recording.samples.reshape(40, 15)
    for form, ending, subtype in (("W64", "w64", "DOUBLE"), ("RF64", "rf64", "PCM_24"), ("WAV", "wav", "ULAW")):
        soundfile.write(folder / f"foreign.{ending}", samples / 8, 1000, subtype=subtype, format=form)
    savemat(folder / "foreign.mat", {"x": samples, "name": "skin", "cell": np.array([{}], object)})
    (folder / "a.xdf").write_bytes(xdf.whole(xdf(samples, labels=tuple("abcdefghijklmno"), unit="volts")))
    columns = {f"mic {i}": column for i, column in enumerate(samples.T)}
    (folder / "a.tdms").write_bytes(tdms(columns) + tdms(columns, interleaved=True))
    (folder / "a.mcap").write_bytes(mcap({"/skin": [row.tolist() for row in samples]}, chunk_size=3000))
    cdr = [b"\0\1\0\0" + struct.pack("<III4x15d", 0, 0, 15, *row) for row in samples]
    ros = {"encoding": "cdr", "schema": "std_msgs/msg/Float64MultiArray", "compress": False}
    (folder / "ros.mcap").write_bytes(mcap({"/skin": cdr}, **ros))
    return folder


def load_foreign(path):
    return load(path, unit="V", sensor=SensorGrid(rows=3, columns=5))


def load_array(path):
    return load(path, rate=1000, unit="V", sensor=SensorGrid(rows=3, columns=5))


READERS = {
    "a.h5": (load, load_calibration, load_pressure),
    "a.calibration.h5": (load_calibration,),
    "a.drive.h5": (load_solution, load_target),
    "a.csv": (load,),
    "foreign.csv": (load,),
    "a.wav": (load,),
    "foreign.wav": (load_foreign,),
    "foreign.w64": (load_foreign,),
    "foreign.rf64": (load_foreign,),
    "a.npz": (load,),
    "a.mat": (load,),
    "foreign.mat": (load_array,),
    "a.nc": (load, load_calibration),
    "a.xdf": (load_foreign,),
    "a.tdms": (load_foreign,),
    "a.mcap": (load_foreign,),
    "ros.mcap": (load_foreign,),
}


def refusals(name, count, originals, tmp_path):
    """Errors of the readers for `count` mutants."""
    rng = np.random.default_rng(2020)
    data = (originals / name).read_bytes()
    path = tmp_path / name
    said = []
    for reader in READERS[name]:
        assert reader(originals / name) is not None
    for _ in range(count):
        path.write_bytes(bytes_anywhere(data, rng))
        for reader in READERS[name]:
            try:
                reader(path)
            except MidairError as wrong:
                said.append(str(wrong))
    assert all(sentence.startswith(str(path)) and "\n" not in sentence for sentence in said)
    return said


@pytest.mark.parametrize("name", [name for name in READERS if name != "a.nc"])  # whose reader is that of a.h5
def test_survives_damage(name, originals, tmp_path):
    assert len(refusals(name, 60, originals, tmp_path)) > 6


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_survives_much_damage(name, originals, tmp_path):
    assert len(refusals(name, 10_000, originals, tmp_path)) > 1000
