from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from midair.files import save
from midair.model import (
    Acoustics,
    AmplitudeFrames,
    Calibration,
    ControlGrid,
    Crosstalk,
    Drive,
    Linearity,
    Measurement,
    Medium,
    Provenance,
    Recording,
    SensorGrid,
    Solution,
    TransducerArray,
)

CALIBRATION_BINS = ("coherence", "magnitude_uncertainty", "phase_uncertainty", "noise_density")
CALIBRATION_LINE = [f"{name}{end}" for name in ("gain", "intercept", "curvature") for end in ("", "_uncertainty")]


@pytest.fixture(scope="session")
def provenance() -> Provenance:
    life = Provenance(source="virtual:towel é", simulated=True, notes={"object": 'towel, "wet"\n\u2028µ'})
    return life.then("record", {"band": (20.0, 470.0), "n": 3, "on": True, "none": None, "deep": ("a", (1, 2.5))})


@pytest.fixture(scope="session")
def recording(provenance: Provenance) -> Recording:
    samples = np.random.default_rng(7).normal(size=(40, 3, 5))
    sensor = SensorGrid(rows=3, columns=5, pitch=7e-3, name="palm µ")
    return Recording(samples=samples, rate=1000 / 3, sensor=sensor, unit="Pa", provenance=provenance)


@pytest.fixture
def options(recording: Recording) -> dict[str, Any]:
    """Options that the writer of `recording` needs."""
    return {"rate": recording.rate, "sensor": recording.sensor, "unit": "Pa", "provenance": recording.provenance}


@pytest.fixture
def path(recording, calibration, tmp_path):
    """A file of `recording` with its calibration."""
    save(recording, tmp_path / "towel.h5", calibration=calibration)
    return tmp_path / "towel.h5"


@pytest.fixture(scope="session")
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
        version=3,
        measurement=Measurement(
            **{name: rng.random((3, *shape)) for name in CALIBRATION_BINS},
            **{name: rng.random(shape) for name in ("noise_uncertainty", "delay", "delay_uncertainty")},
            reference_uncertainty=0.01,
            reference="force cell µ",
            method="sweeps",
            takes=7,
        ),
        crosstalk=Crosstalk(matrix=np.eye(15) + np.triu(rng.random((15, 15)), 1), uncertainty=rng.random((15, 15))),
        linearity=Linearity(
            **{name: rng.random((5, *shape)) for name in ("pressure", "output")},
            **{name: rng.random(shape) for name in CALIBRATION_LINE},
        ),
    )


@pytest.fixture(scope="session")
def solution(provenance: Provenance) -> Solution:
    rng = np.random.default_rng(9)
    array = TransducerArray.autd3(columns=1, rows=1)
    drive = Drive(
        phase=rng.integers(0, 256, (4, array.count)) / (256 / (2 * np.pi)),
        level=rng.random(4),
        rate=1000,
        array=array,
        acoustics=Acoustics(medium=Medium.at(temperature=24.5, humidity=0.4), directivity="piston"),
        provenance=provenance,
    )
    status = ("converged", "iterations", "stalled", "silent")
    return Solution(drive=drive, error=rng.random(4), iterations=np.array([50, 20, 20, 0]), status=status)


@pytest.fixture(scope="session")
def target(solution: Solution) -> AmplitudeFrames:
    grid = ControlGrid(rows=2, columns=3, pitch=4e-3, height=0.15, centre=(1e-3, -2e-3))
    amplitude = np.float32(np.random.default_rng(10).random((4, 6)) * 3000)
    return AmplitudeFrames(amplitude=amplitude, rate=1000, grid=grid, provenance=Provenance(source="prepare"))


@pytest.fixture(scope="session")
def alike() -> Callable[[Recording, Recording], None]:
    def check(one: Recording, other: Recording) -> None:
        np.testing.assert_array_equal(one.samples, other.samples)
        assert (one.rate, one.unit, one.sensor) == (other.rate, other.unit, other.sensor)
        assert one.provenance == other.provenance

    return check
