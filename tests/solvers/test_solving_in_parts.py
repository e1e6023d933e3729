"""A recording part by part is the recording as a whole."""

from dataclasses import replace

import numpy as np
import pytest

from midair.model import AmplitudeFrames, ControlGrid, Solution, TransducerArray
from midair.solvers import PLAIN, Free, Glide, solve, solve_parts
from midair.solvers.solve_plan import SolvePlan
from midair.streaming import LazyFrames

UNIT, GRID = TransducerArray.autd3(columns=1, rows=1), ControlGrid(rows=6, columns=6, pitch=10e-3)

PARTS = {
    "fast, automatic": {"method": "fast", "level": "auto"},
    "lm": {"method": "lm", "iterations": 2},
    "lm, on their own": {"method": "lm", "iterations": 2, "start": "zero"},
    "lm, plain": {"method": PLAIN, "iterations": 1},
    "fast": {"method": "fast"},
    "fast, smooth": {"method": "fast", "smooth": 0.01},
    "fast, bounded": {"method": "fast", "amplitudes": "bounded"},
    "fast, cells": {"method": "fast", "fit": "cells"},
    "glide": {"method": Glide(block=64)},
    "free": {"method": Free(block=16, iterations=20, between=4), "quiet_ears": 1.0},
}


@pytest.mark.long
def test_a_recording_in_parts_is_solved_as_a_whole(monkeypatch, subtests):
    monkeypatch.setattr("midair.solvers.solve_plan.TOGETHER", 64)
    frame = np.arange(150)[:, None]
    place = 18 + 10 * np.sin(2 * np.pi * frame / 150)
    amplitude = 2000 * np.abs(np.sin(frame / 25)) * np.exp(-(((np.arange(36) - place) / 5) ** 2))
    # Silence at the beginning, across a joint, and at the end.
    amplitude[:3] = amplitude[60:70] = amplitude[148:] = 0
    whole, calls = AmplitudeFrames(amplitude=amplitude, rate=1000, grid=GRID), []
    reel = replace(whole, amplitude=LazyFrames(lambda first, last: amplitude[first:last], amplitude.shape))
    for name, settings in PARTS.items():
        with subtests.test(settings=name):
            made = solve(whole, UNIT, **settings)
            parts = list(solve_parts(reel, UNIT, progress=lambda *told: calls.append(told), **settings))
            assert len(parts) > 1
            assert all(part.drive.provenance == made.drive.provenance for part in parts)
            again = Solution.joined(parts)
            # Rounding: products of another number of frames differ in the last digit.
            np.testing.assert_allclose(again.drive.phase, made.drive.phase, atol=1e-9)
            np.testing.assert_allclose(again.drive.level, made.drive.level, rtol=1e-9)
            np.testing.assert_allclose(again.error, made.error, rtol=1e-4, atol=1e-6)
            np.testing.assert_array_equal(again.iterations, made.iterations)
            assert again.status == made.status
    assert {total for _, total in calls} == {150}


def test_a_later_part_uses_the_matrices_of_the_first():
    amplitude = np.random.default_rng(0).uniform(100, 200, (5, 36))
    target = AmplitudeFrames(amplitude=amplitude, rate=1000, grid=GRID)
    plan = SolvePlan.of(target, UNIT, method="glide")
    _, first = plan.solve(replace(target, amplitude=amplitude[:3]), None, None)
    _, later = plan.solve(replace(target, amplitude=amplitude[2:]), first, None)
    (_, before), (_, after) = first.known, later.known
    assert after.field is before.field
    assert len(after.operators.problem.amplitude) == 3


def test_a_target_of_two_parts_is_solved_at_once_unless_its_first_part_is_early():
    amplitude = 100 + 20 * np.sin(np.arange(100)[:, None] / 20 + np.arange(36))
    target = AmplitudeFrames(amplitude=amplitude, rate=1000, grid=GRID)
    parts = list(solve_parts(target, UNIT, method=Glide(block=64)))
    (whole,) = solve_parts(target, UNIT, early=False, method=Glide(block=64))
    assert [part.drive.frames for part in parts] == [65, 35]
    np.testing.assert_array_equal(np.concatenate([part.drive.phase for part in parts]), whole.drive.phase)
    assert len(list(solve_parts(target, UNIT, early=False, method=Glide(block=32)))) == 4
