from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from tests.palms import palm_path

from midair.model import Acoustics, ControlGrid, Drive, PalmPath, TransducerArray
from midair.physics import (
    MovingSpread,
    PalmFit,
    aims_of,
    array_from_palm,
    focus_phase,
    middle_of,
    on_the_palm,
    pose_of,
    poses_at,
    radiation_pressure,
    steering_phase,
    transfer_matrix,
)

ARRAY = TransducerArray.autd3(columns=1, rows=1)
AIR = Acoustics()
GRID = ControlGrid(rows=6, columns=6, pitch=5e-3)
SOLVED = middle_of(GRID)


def hand(seed: int = 0, poses: int = 6, duration: float = 0.1) -> PalmPath:
    """A palm that moves by some mm and degrees between poses."""
    rng = np.random.default_rng(seed)

    def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)

    walk = np.cumsum(rng.standard_normal((3, poses, 3)), axis=1)
    normal = unit(0.03 * walk[1] + [0, 0, -1])
    fingers = 0.03 * walk[2] + [0, 1, 0]
    return PalmPath(
        time=np.linspace(0, duration, poses),
        centre=2e-3 * walk[0] + SOLVED,
        normal=normal,
        fingers=unit(fingers - (fingers * normal).sum(axis=1, keepdims=True) * normal),
        confidence=np.full(poses, 0.9),
    )


def test_a_focus_on_the_aim_stays_a_focus_on_the_moved_palm() -> None:
    path, rest = hand(), palm_path(np.zeros(1), SOLVED[None])
    assert np.abs(steering_phase(ARRAY, AIR.medium, SOLVED, rest)).max() == 0
    for aim in (SOLVED, np.add(SOLVED, (8e-3, -5e-3, 0))):
        steered = focus_phase(ARRAY, aim, acoustics=AIR) + steering_phase(ARRAY, AIR.medium, SOLVED, path, aim=aim)
        for number, place in enumerate(on_the_palm(aim[None], SOLVED, path)[:, 0]):
            off = np.exp(1j * (steered[number] - focus_phase(ARRAY, place, acoustics=AIR)))
            # One phase for all transducers is free.
            assert np.abs(off - off[0]).max() < 1e-6


def test_the_fit_restores_the_pressure_that_steering_loses_on_a_tilted_and_turned_palm(subtests) -> None:
    """Two soft spots; the pressure is computed by the exact transfer matrix at points between those of the fit."""
    for before, kept in [(1e-2, False), (4e-4, True)]:
        with subtests.test(before=before):
            array, palm = TransducerArray.autd3(), ControlGrid(rows=16, columns=16, pitch=11e-3 / 3)
            centre, turned = middle_of(palm), hand(seed=3)
            pose = replace(pose_of(turned, 4), centre=centre[None] + [[5e-3, 5e-3, 5e-3]])
            matrix = transfer_matrix(palm, array, acoustics=AIR)
            away = [
                np.linalg.norm(palm.position - centre - each, axis=1) for each in ((-9e-3, -6e-3, 0), (9e-3, 3e-3, 0))
            ]
            phase = np.angle(np.exp(-((np.array(away) / 6e-3) ** 2)).sum(axis=0) @ matrix.conj())[None]
            there = transfer_matrix(on_the_palm(palm.position, centre, pose)[0], array, acoustics=AIR)
            steered = phase + steering_phase(array, AIR.medium, centre, pose)
            fit = PalmFit(array, AIR, palm)
            fit.move(replace(pose, centre=pose.centre - [[before, 0, 0]]))
            fit.move(pose)
            assert (fit.pose is not pose) == kept
            fitted = steered + np.angle(fit(phase, steered))
            wanted, *felt = (
                np.abs(np.exp(1j * each) @ at.T) ** 2
                for each, at in ((phase, matrix), (steered, there), (fitted, there))
            )
            lost, left = (float(np.linalg.norm(each - wanted) / np.linalg.norm(wanted)) for each in felt)
            assert left < 0.7 * lost < 0.3


def test_the_array_from_a_palm_makes_the_field_at_the_moved_points() -> None:
    pose = pose_of(hand(), 4)
    there = transfer_matrix(on_the_palm(GRID.position, SOLVED, pose)[0], ARRAY)
    assert np.allclose(transfer_matrix(GRID, array_from_palm(ARRAY, SOLVED, pose)), there, rtol=1e-9)


def test_poses_between_are_smooth_unit_vectors_and_the_ends_hold() -> None:
    path = hand()
    time = np.array([-1.0, 0.0, 0.0333, 0.06, 0.1, 9.0])
    found = poses_at(path, time)
    assert np.allclose(found.centre[[0, 1, 3, 4, 5]], path.centre[[0, 0, 3, 5, 5]], atol=1e-12)
    assert np.allclose(found.rotation @ np.swapaxes(found.rotation, 1, 2), np.eye(3), atol=1e-9)
    assert np.allclose(found.confidence, 0.9)
    assert len(poses_at(pose_of(path, 0), time).time) == 6


def test_the_aim_is_where_the_pressure_changes() -> None:
    places = SOLVED + np.array([[8e-3, 0, 0], [-8e-3, 4e-3, 0]])
    phase = np.repeat([focus_phase(ARRAY, place, acoustics=AIR) for place in places], 200, axis=0)
    blinks = np.arange(400) % 10 < 5
    drive = Drive(phase=phase, level=blinks.astype(float), rate=1000.0, array=ARRAY, acoustics=AIR)
    aims = aims_of(drive, GRID, smooth=0.005)
    assert np.abs(aims[100] - places[0]).max() < 3e-3
    assert np.abs(aims[300] - places[1]).max() < 3e-3


def test_the_pressure_on_a_moving_palm_is_that_at_every_moment(subtests) -> None:
    for splits in [(), (37, 40)]:
        with subtests.test(splits=splits):
            path, rng, steps = hand(duration=0.02), np.random.default_rng(1), 160
            phase = focus_phase(ARRAY, SOLVED, acoustics=AIR) + rng.standard_normal(ARRAY.count)
            q = np.exp(1j * (phase + np.cumsum(0.02 * rng.standard_normal((steps, ARRAY.count)), axis=0)))
            moving = MovingSpread(GRID.position, ARRAY, AIR, solved=SOLVED, path=path, rate=8000.0)
            parts = np.split(np.arange(steps), splits)
            found = np.concatenate([moving.pressure(q[part], int(part[0])) for part in parts])
            poses = poses_at(path, np.arange(1, steps + 1) / 8000.0)
            points = on_the_palm(GRID.position, SOLVED, poses)
            some = range(0, steps, 9)
            exact = [radiation_pressure(np.abs(transfer_matrix(points[at], ARRAY) @ q[at]), AIR.medium) for at in some]
            assert np.linalg.norm(found[::9] - exact) < 1e-3 * np.linalg.norm(exact)
