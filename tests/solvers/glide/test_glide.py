"""The recording solver: as accurate as the batch solver, smooth in time, and independent of block sizes."""

from dataclasses import replace

import numpy as np
import pytest

from midair.solvers import Fast, Glide, error_of
from midair.solvers.field_operators import evenly_spread
from midair.solvers.glide import FrameBlock
from midair.solvers.problem import GuardField


def rms_step(phase):
    return np.sqrt((np.angle(np.exp(1j * np.diff(phase, axis=0))) ** 2).mean())


@pytest.fixture(scope="module")
def spot(problem_of, moving_spot):
    return problem_of(moving_spot(140))


@pytest.fixture(scope="module")
def glided(spot):
    return Glide(block=64).solve(spot)


@pytest.fixture(scope="module")
def batch(spot):
    return Fast().solve(spot)


@pytest.mark.long
def test_a_moving_spot_is_as_true_as_by_the_batch_solver_keeps_still_and_takes_far_fewer_iterations(
    spot, glided, batch
):
    ours, theirs = error_of(spot, glided.phase), error_of(spot, batch.phase)
    assert ours.mean() <= theirs.mean()
    assert rms_step(glided.phase) <= 0.25 < rms_step(batch.phase)
    assert glided.iterations.sum() < batch.iterations.sum() / 2


@pytest.mark.long
def test_a_towel_is_as_true_as_by_the_batch_solver(problem_of, towel):
    problem = problem_of(towel(150))
    ours, theirs = Glide().solve(problem), Fast().solve(problem)
    assert error_of(problem, ours.phase).mean() <= error_of(problem, theirs.phase).mean()
    assert rms_step(ours.phase) <= 0.25


@pytest.mark.long
def test_a_short_first_step_ends_nearer_and_the_last_level_alone_has_its_own_iterations(spot, glided):
    errors = [error_of(spot, Glide(block=64, near=0.2, smooth=4, first=first).solve(spot).phase) for first in (0.25, 1)]
    assert errors[0].mean() < 0.97 * errors[1].mean()
    fewer = Glide(block=64, smooth_last=2).solve(spot)
    others = fewer.iterations != glided.iterations
    assert np.flatnonzero(others)[0] % 2 == 1
    assert not others[::2].any()
    assert (fewer.iterations[others] == 2).all()


@pytest.mark.parametrize("jobs", [2, pytest.param(4, marks=pytest.mark.long)])
def test_any_number_of_jobs_gives_the_same_to_the_last_bit(problem_of, moving_spot, jobs):
    problem = problem_of(moving_spot(40))
    one, more = (Glide(block=16, jobs=each).solve(problem).phase for each in (1, jobs))
    assert np.array_equal(one, more)


def test_there_is_no_seam_between_blocks(glided):
    change = np.sqrt((np.angle(np.exp(1j * np.diff(glided.phase, axis=0))) ** 2).mean(axis=1))
    seams = change[[63, 64, 127, 128]]
    assert seams.max() <= np.quantile(change, 0.99)


@pytest.mark.long
def test_later_frames_do_not_change_a_block_and_its_next_mark(spot, glided):
    # Block 2 ends at frame 128, a mark; more of the recording must not move what is before.
    part = Glide(block=64).solve(replace(spot, amplitude=spot.amplitude[:129]))
    assert np.array_equal(part.phase[:128], glided.phase[:128])


def test_recordings_of_any_length(problem_of, moving_spot):
    for frames in (1, 2, 3, 31, 33):
        problem = problem_of(moving_spot(frames))
        assert error_of(problem, Glide().solve(problem).phase).max() < 0.1, frames


@pytest.mark.long
def test_frames_that_have_nothing_to_do_with_their_neighbours_get_phases_of_their_own(problem_of, patterns_to_points):
    bits = np.random.default_rng(5).choice(np.arange(1, 65536), 40, replace=False)
    problem = problem_of(0.1 * patterns_to_points([int(each) for each in bits]))
    ours, theirs = Glide().solve(problem), Fast().solve(problem)
    # Neighbours are of no use here, so only the iterations for rough frames matter.
    assert error_of(problem, ours.phase).mean() <= 1.1 * error_of(problem, theirs.phase).mean()


@pytest.mark.long
def test_silence_is_left_out_and_held(spot):
    amplitude = spot.amplitude[:60].copy()
    amplitude[:3], amplitude[20:30] = 0, 0
    answer = Glide().solve(replace(spot, amplitude=amplitude))
    assert [status == "silent" for status in answer.status] == list(~amplitude.any(axis=1))
    assert not answer.phase[:3].any()
    assert np.array_equal(answer.phase[20:30], np.repeat(answer.phase[19:20], 10, axis=0))


@pytest.mark.long
def test_a_guard_keeps_its_ring_quiet(spot, array):
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    ring = np.stack([0.055 * np.cos(angle), 0.055 * np.sin(angle), np.full(24, 0.2)], axis=1)
    distance = np.linalg.norm(ring[:, None] - array.position, axis=2)
    G = np.exp(739.2j * distance) / distance
    G *= np.abs(spot.G).max() / np.abs(G).max()
    guarded = replace(spot, guard=GuardField(G=G, ceiling=0.1, weight=1.0))
    loud, quiet = (
        np.abs(np.exp(1j * Glide().solve(problem).phase) @ G.T).max(axis=1).mean() for problem in (spot, guarded)
    )
    assert quiet < 0.7 * loud


def test_sampled_transducers_are_spread_over_the_array(array):
    sampled = evenly_spread(array.position, every=4, count=array.count)
    assert len(sampled) == len(set(sampled.tolist())) == 249
    away = np.linalg.norm(array.position[:, None] - array.position[sampled], axis=2).min(axis=1)
    # A quarter of them, evenly: no transducer is farther than two pitches from a sampled one.
    assert away.max() <= 2 * 10.16e-3
    assert evenly_spread(None, every=4, count=10).tolist() == [0, 4, 8]


def test_blocks_that_have_not_begun_are_dropped_by_ctrl_c(spot, monkeypatch):
    begun, solve = [], FrameBlock.solve
    monkeypatch.setattr(FrameBlock, "solve", lambda block, marks: begun.append(marks) or solve(block, marks))

    def stop(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Glide(coarse=8, block=8, cold=(2, 2, 2)).solve(spot, progress=stop)
    assert 1 <= len(begun) < 17 == (140 - 1) // 8
