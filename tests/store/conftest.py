from collections.abc import Callable

import numpy as np
import pytest

from midair.model import (
    AmplitudeFrames,
    Calibration,
    ControlGrid,
    Drive,
    Provenance,
    Recording,
    SensorGrid,
    Solution,
    TransducerArray,
)


@pytest.fixture
def provenance() -> Provenance:
    life = Provenance(source="virtual:towel é", simulated=True, notes={"object": 'towel, "wet"\n\u2028µ'})
    return life.then("record", {"band": (20.0, 470.0), "n": 3, "on": True, "none": None, "deep": ("a", (1, 2.5))})


@pytest.fixture
def recording(provenance: Provenance) -> Recording:
    samples = np.random.default_rng(7).normal(size=(40, 3, 5))
    sensor = SensorGrid(rows=3, columns=5, pitch=7e-3, name="palm µ")
    return Recording(samples=samples, rate=1000 / 3, sensor=sensor, unit="Pa", provenance=provenance)


@pytest.fixture
def calibration(recording: Recording) -> Calibration:
    rng = np.random.default_rng(8)
    shape = recording.sensor.shape
    return Calibration(
        sensor=recording.sensor,
        frequency=np.array([0.0, 20.0, 470.0]),
        response=rng.normal(size=(3, *shape)) + 1j * rng.normal(size=(3, *shape)),
        noise=rng.random(shape),
        unit="V",
        date="2026-11-20",
        provenance=Provenance(source="bench"),
    )


@pytest.fixture
def solution(provenance: Provenance) -> Solution:
    rng = np.random.default_rng(9)
    array = TransducerArray.autd3(columns=1, rows=1)
    drive = Drive(
        phase=rng.uniform(-np.pi, np.pi, (4, array.count)),
        level=rng.random(4),
        rate=1000,
        array=array,
        provenance=provenance,
    )
    status = ("converged", "iterations", "stalled", "silent")
    return Solution(drive=drive, error=rng.random(4), iterations=np.array([50, 20, 20, 0]), status=status)


@pytest.fixture
def target(solution: Solution) -> AmplitudeFrames:
    grid = ControlGrid(rows=2, columns=3, pitch=4e-3, height=0.15, centre=(1e-3, -2e-3))
    amplitude = np.random.default_rng(10).random((4, 6)) * 3000
    return AmplitudeFrames(amplitude=amplitude, rate=1000, grid=grid, provenance=Provenance(source="prepare"))


@pytest.fixture
def alike() -> Callable[[Recording, Recording], None]:
    def check(one: Recording, other: Recording) -> None:
        np.testing.assert_array_equal(one.samples, other.samples)
        assert (one.rate, one.unit, one.sensor) == (other.rate, other.unit, other.sensor)
        assert one.provenance == other.provenance

    return check
