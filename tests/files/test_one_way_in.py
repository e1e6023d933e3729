import shlex

import numpy as np
import pytest

from midair.cli import run
from midair.files import FORMATS, open_take, save
from midair.model import Recording
from midair.rig import VirtualRig, sensor_named

STORED = (".h5", ".hdf5")


@pytest.fixture(scope="module")
def take():
    rig = VirtualRig(seed=3)
    model = rig.sensor_model
    samples = np.random.default_rng(0).normal(scale=0.1, size=(300, 4, 4))
    from midair.physics import calibration_of

    return Recording(samples=samples, rate=1000.0, sensor=model.grid), calibration_of(model)


WRITTEN = [ending for ending, form in FORMATS.items() if form.write and ending != ".flac"]


@pytest.mark.parametrize("ending", WRITTEN)
@pytest.mark.parametrize("case", [str.lower, str.upper, str.title])
def test_every_ending_in_any_case_gives_all_that_its_file_holds(take, ending, case, tmp_path):
    recording, calibration = take
    path = tmp_path / case(f"take{ending}")
    lost = save(recording, path, calibration=calibration)
    sound = ending == ".wav"  # which holds parts of full scale, and no unit
    opened = open_take(path, **({"unit": "V"} if sound else {}))
    full = 2.0 ** np.ceil(np.log2(np.abs(recording.samples).max())) if sound else 1.0
    np.testing.assert_allclose(full * opened.recording.samples, recording.samples, atol=1e-6)
    kept = ending in STORED
    assert opened.stored is kept
    assert (opened.calibration is not None) is kept
    # A format that cannot store a calibration reports it when writing.
    assert any(loss.what == "calibration" for loss in lost) is not kept
    if opened.calibration is not None:
        np.testing.assert_array_equal(opened.calibration.response, calibration.response)


@pytest.mark.long
@pytest.mark.parametrize("name", ["take.h5", "TAKE.H5", "take.hdf5"])
def test_no_command_loses_a_calibration_by_the_files_name(take, name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    recording, calibration = take
    save(recording, name, calibration=calibration)
    assert run(["info", name]) == 0
    assert "none; state one" not in capsys.readouterr().out
    assert run(["cut", name, "part.h5", "--start", "50ms", "--end", "150ms"]) == 0
    assert open_take("part.h5").calibration is not None
    assert run(["import", name, "in.h5"]) == 0
    assert open_take("in.h5").calibration is not None
    words = shlex.split(
        "--mode paper --set target.grid={rows=6,columns=6,pitch=0.011} --duration 5ms --set solver.iterations=[1,1]"
    )
    assert run(["solve", name, "x.drive.h5", *words]) == 0
    assert sensor_named(f"replay:{name}", VirtualRig()).calibration is not None
