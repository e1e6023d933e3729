import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from midair.errors import InputError
from midair.model import Acoustics, AmplitudeFrames, Medium, TransducerArray
from midair.physics import focus_amplitude
from midair.solvers import solve
from midair.sweep.pattern_sweep import Condition, PatternSweep, problem_of, solve_patterns
from midair.sweep.storage import settings_of
from midair.targets import interpolation_matrix


@dataclass(frozen=True)
class Inner:
    place: tuple[int, ...]
    path: Path


@dataclass(frozen=True)
class Outer:
    inner: Inner
    heights: dict


def test_settings_of_objects_at_hand():
    outer = Outer(inner=Inner(place=(1, 2), path=Path("a/b")), heights={150: 0.15, 200: [True]})
    assert settings_of(outer) == {
        "inner": {"place": [1, 2], "path": str(Path("a/b"))},
        "heights": {"150": 0.15, "200": [True]},
    }


SMALL = PatternSweep(count=20, curve_count=8, chunk=6, strengths=(0.1,), method="naive")


def test_the_default_is_the_paper_s_experiment():
    sweep = PatternSweep()
    assert len(sweep.patterns()) == 65535
    assert sweep.conditions()[0] == Condition(strength=0.1, height=0.2, count=65535)
    assert sweep.acoustics.directivity == "point"
    assert sweep.acoustics.medium.attenuation == 0


def test_each_pair_of_strength_and_height_comes_once():
    conditions = PatternSweep().conditions()
    pairs = [(one.strength, one.height) for one in conditions]
    assert len(set(pairs)) == len(pairs) == 2 + 5 + 2 * 6
    assert {one.count for one in conditions} == {65535, 512}


def test_the_tasks_are_every_pattern_of_every_condition_once():
    done = [(task.condition, place) for task in SMALL.tasks() for place in range(task.first, task.last)]
    asked = [(number, place) for number, one in enumerate(SMALL.conditions()) for place in range(one.count)]
    assert sorted(done) == sorted(asked)
    assert [task.first for task in SMALL.tasks()] == sorted(task.first for task in SMALL.tasks())


def test_settings_survive_json():
    settings = json.loads(json.dumps(SMALL.settings()))
    assert settings == SMALL.settings()
    assert PatternSweep.of_settings(settings) == SMALL


def test_settings_name_those_of_the_solver():
    assert PatternSweep(iterations=7).settings()["solver"]["iterations"] == 7


def test_results_are_marked_as_simulated():
    provenance = SMALL.provenance()
    assert provenance.simulated
    assert provenance.steps[-1].settings["seed"] == 2024


def test_a_target_s_peak_is_strength_times_the_focus():
    condition = Condition(strength=0.15, height=0.25, count=1)
    problem = problem_of(SMALL, condition, np.array([0xFFFF]))
    assert problem.amplitude.max() == pytest.approx(0.15)
    assert np.abs(problem.G).sum(axis=1).max() == pytest.approx(1)


@pytest.mark.long
def test_agrees_with_the_stage_of_the_pipeline():
    """The same patterns as targets in Pa, through `midair.solve`."""
    patterns, condition = SMALL.patterns()[:3], Condition(strength=0.1, height=0.2, count=3)
    array, grid, air = TransducerArray.autd3(), SMALL.grid(0.2), Medium(attenuation=0)
    loud = (patterns[:, None] >> np.arange(16)) & 1
    focus = focus_amplitude(grid, array, acoustics=Acoustics(medium=air, directivity="point"))
    target = AmplitudeFrames(
        amplitude=0.1 * focus * loud @ interpolation_matrix(SMALL.sensor, grid).T, rate=1.0, grid=grid
    )
    sweep = PatternSweep(method="gs-pat")
    for bits, name in ((None, "error"), (8, "rounded_error")):
        solution = solve(
            target, array, method="gs-pat", acoustics=Acoustics(medium=air, directivity="point"), bits=bits
        )
        np.testing.assert_allclose(getattr(solve_patterns(sweep, condition, patterns), name), solution.error, rtol=1e-9)


@pytest.mark.parametrize(
    "wrong",
    [
        {"count": 0},
        {"count": 65536},
        {"curve_count": -1},
        {"chunk": 0},
        {"bits": 0},
        {"strengths": ()},
        {"heights": (-0.1,)},
        {"curve_strengths": (0.1, float("nan"))},
        {"method": "magic"},
        {"iterations": 0},
    ],
    ids=str,
)
def test_invalid_sweeps_are_rejected(wrong):
    with pytest.raises(InputError):
        PatternSweep(**wrong)
