import numpy as np
import pytest

from midair.files import save, save_calibration, save_solution
from midair.model import Calibration, Drive, Provenance, Recording, SensorGrid, Solution, TransducerArray


def test_json_of_a_recording_has_stable_keys(answer):
    samples = np.random.default_rng(0).normal(size=(250, 4, 4))
    samples[:, 0, 2] = 0
    life = Provenance(source="bench", notes={"object": "towel"})
    take = Recording(samples=samples, rate=500, provenance=life)
    save(take, "take.h5", calibration=Calibration.flat(take.sensor, sensitivity=0.02))
    found = answer("info", "take.h5")
    assert (found["kind"], found["frames"], found["rate_hz"], found["duration_s"]) == ("recording", 250, 500, 0.5)
    assert found["sensor"] == {"name": take.sensor.name, "rows": 4, "columns": 4, "pitch_m": take.sensor.pitch}
    assert found["range"] == pytest.approx([samples.min(), samples.max()])
    assert (found["dead_channels"], found["notes"], found["calibration"]["version"]) == ([2], {"object": "towel"}, 1)
    assert found["largest_pressure_pa"] is None


def test_json_of_a_drive_and_of_a_calibration_has_stable_keys(answer):
    array = TransducerArray.autd3()
    phase = np.zeros((4, array.count))
    drive = Drive(phase=phase, level=[0.5, 1, 1, 0], rate=1000, array=array)
    status = ("converged", "converged", "converged", "silent")
    solution = Solution(drive=drive, error=[0.1, 0.2, 0.3, 0], iterations=[1, 1, 1, 0], status=status)
    save_solution(solution, "take.drive.h5")
    found = answer("info", "take.drive.h5")
    assert (found["kind"], found["frames"], found["rate_hz"], found["duration_s"]) == ("drive", 4, 1000, 0.004)
    assert (found["silent_frames"], found["array"]["transducers"]) == (1, array.count)
    assert (found["E_mean"], found["E_worst"]) == pytest.approx((0.2, 0.3))
    save_calibration(Calibration.flat(SensorGrid(), sensitivity=0.02), "flat.calibration.h5")
    assert answer("info", "flat.calibration.h5")["kind"] == "calibration"
