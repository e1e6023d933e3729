import numpy as np
import psutil
import pytest

from midair.devices import FrameBlock, SensorDevice
from midair.model import SensorGrid
from midair.rig.takes.take import record_take
from midair.rig.takes.take_state import RecordSettings, TakeObserver

MIB = 2**20


class Endless(SensorDevice):
    """16 channels at 48 kHz, as fast as they are taken; some frames are lost, and all channels clip."""

    name, grid, rate, unit, full_scale = "endless", SensorGrid(), 48_000.0, "V", 3.5

    def __init__(self):
        rng = np.random.default_rng(0)
        self.noise = np.clip(rng.normal(size=(48_000, 4, 4)), -3.5, 3.5)
        self.first = 0

    def stop(self): ...
    def start(self): ...

    def read(self, frames):
        self.first += 100 if self.first % 480_000 == 0 and self.first else 0
        first, self.first = self.first, self.first + frames
        at = first % (48_000 - frames)
        return FrameBlock(
            samples=self.noise[at : at + frames], first=first, device_time=first / 48e3, host_time=first / 48e3
        )


class Scales(TakeObserver):
    """Weighs the program each second of the recording."""

    def __init__(self):
        self.weights, self.told = {}, 0

    def show(self, view):
        self.weights.setdefault(view.frames // 48_000, psutil.Process().memory_info().rss)

    def tell(self, event, drift=None):
        self.told += 1


@pytest.mark.slow
def test_the_memory_stays_flat_at_sixteen_channels_of_48_khz(tmp_path, capsys):
    seconds, path, scales = 120, tmp_path / "long.h5", Scales()
    with Endless() as sensor:
        made = record_take(sensor, RecordSettings(duration=seconds, level=3.0, pre_roll=0.0), scales, path=path)
    assert made.frames == seconds * 48_000
    early = max(weight for second, weight in scales.weights.items() if 5 <= second <= 10)
    late = max(weight for second, weight in scales.weights.items() if second >= seconds - 10)
    size = path.stat().st_size
    with capsys.disabled():
        print(
            f"\n{seconds} s, {size / 1e6:.0f} MB written: {early / MIB:.1f} MiB at 5 to 10 s, "
            f"{late / MIB:.1f} MiB at the end; {made.lost} frames lost, {scales.told} events told"
        )
    assert late - early < 8 * MIB, f"a file of {size / MIB:.0f} MiB"
