import runpy
from pathlib import Path

import numpy as np
import pytest

from midair.evaluate import felt
from midair.files import load, load_solution, load_target
from midair.model import frames_without_lead
from midair.settings import Settings
from midair.studio.folders import StudioFolder
from midair.studio.solved_sample import STORED, orbit
from midair.studio.takes_list import TakesList
from midair.studio.work import make_sample

SCRIPT = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "solved_sample.py"))


def test_a_small_file_holds_one_period_without_a_seam():
    kept = load_solution(STORED)
    assert Settings.of(kept.drive.provenance), "the panel shows the settings of a drive"
    assert STORED.stat().st_size < 1e6
    assert kept.drive.frames / kept.drive.rate == pytest.approx(0.2)
    phase = kept.drive.phase
    changes = [SCRIPT["seam"](phase, (i + 1) % len(phase), i + 1) for i in range(len(phase))]
    # The wavelength is 8.6 mm, and a drive of 1000 Hz changes as much with each frame.
    assert np.sort(changes)[-2] < max(changes) < 0.45
    assert kept.error.mean() < 0.015
    assert kept.error.max() < 0.05


def test_the_sample_is_solved_and_felt_as_soon_as_it_is_listed(tmp_path):
    make_sample((str(tmp_path), "orbit"), lambda *_: None)
    (row,) = TakesList(StudioFolder.at(tmp_path / "own"), tmp_path).rows()
    assert (row["name"], row["sample"], row["solved"]) == ("sample:orbit", True, True)
    take = load(tmp_path / "orbit.h5")
    assert felt(np.asarray(take.samples), take.rate, take.sensor.pitch).people[0] >= 9
    solution, target = load_solution(tmp_path / "orbit.drive.h5"), load_target(tmp_path / "orbit.drive.h5")
    inside = frames_without_lead(target.provenance, target.frames, target.rate)
    assert (inside.stop - inside.start) / target.rate == take.frames / take.rate == orbit().frames / 1000
    assert (solution.drive.level[inside] == 1).all()
    assert solution.drive.level[0] == target.amplitude[0].max() == 0
    assert len({target.amplitude[inside][first : first + 800].tobytes() for first in (0, 800, 1600)}) == 1


@pytest.mark.long
def test_the_script_makes_the_file(tmp_path):
    SCRIPT["solve_period"](made := tmp_path / "made.drive.h5")
    assert load_solution(made).error.mean() == pytest.approx(load_solution(STORED).error.mean(), rel=0.1)
    np.testing.assert_allclose(load_target(made).amplitude, load_target(STORED).amplitude, rtol=1e-3, atol=1)
