import os
from pathlib import Path

import numpy as np
import pytest

from midair.cli.commands.compare import load_touchsim
from midair.errors import InputError
from midair.evaluate import SkinModel, afferent_rates
from midair.model import PressureFrames


def test_a_folder_without_the_package_is_refused(tmp_path):
    with pytest.raises(InputError, match="--touchsim: expected a folder that contains the package touchsim, got"):
        load_touchsim(tmp_path)


def test_a_missing_dependency_is_named(tmp_path):
    (tmp_path / "touchsim").mkdir()
    (tmp_path / "touchsim" / "__init__.py").write_text("import no_such_package\n")
    with pytest.raises(InputError, match="dependencies to be installed, got: No module named 'no_such_package'"):
        load_touchsim(tmp_path)


@pytest.mark.skipif("MIDAIR_TOUCHSIM" not in os.environ, reason="MIDAIR_TOUCHSIM names no copy of TouchSim")
def test_pacinian_fibres_answer_at_the_threshold_of_the_skin_model():
    model = load_touchsim(Path(os.environ["MIDAIR_TOUCHSIM"]))
    time, skin = np.arange(1000) / 1000, SkinModel()

    def rates(over: float, frequency: float) -> dict[str, float]:
        wave = skin.pressure_just_felt * 10 ** (over / 20) * np.sin(2 * np.pi * frequency * time)
        return afferent_rates(PressureFrames(pressure=np.tile(wave[:, None, None], (1, 4, 4)), rate=1000.0), model)

    assert rates(-10, 250.0) == {"SA1": 0, "RA": 0, "PC": 0}
    assert rates(14, 250.0)["PC"] > 5
    assert rates(30, 250.0)["PC"] > 5 * rates(14, 250.0)["PC"]
    assert rates(30, 30.0)["PC"] < 0.1 * rates(30, 250.0)["PC"]
