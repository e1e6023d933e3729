import json

import numpy as np
import pytest

from midair.cli import run
from midair.files import load_sensor, save, save_sensor
from midair.model import Recording, SensorWiring
from midair.rig.names.sensor_names import VirtualRig


@pytest.fixture(scope="module")
def tapped():
    with VirtualRig().touched_by("taps") as sensor:
        sensor.start()
        return sensor.read(17_100).samples.reshape(-1, 16)


def bench(samples):
    save(Recording(samples=samples.reshape(-1, 4, 4), rate=1000.0), "taps.h5")
    return ["identify", "replay:taps.h5", "--every", "1s"]


def test_a_swap_is_shown_and_put_right_in_the_sensor_file(tapped, capsys):
    order = list(range(16))
    order[3], order[7] = 7, 3
    command = [*bench(tapped[:, order]), "--sensor-file", "palm.toml"]
    assert run(command) == 0
    said = capsys.readouterr()
    assert [line.split() for line in said.out.splitlines()[1:5]][:2] == [["0", "1", "2", "7"], ["4", "5", "6", "3"]]
    assert "channels 3 and 7 are swapped" in said.out
    assert "tap row 3, column 3 (16 of 16)" in said.err
    assert load_sensor("palm.toml").order == tuple(order)
    assert run(command) == 0
    assert "every channel is in its place" in capsys.readouterr().out
    assert load_sensor("palm.toml").order == tuple(order)


def test_the_right_order_is_worked_out_on_top_of_a_wrong_one(tapped):
    """The file says one permutation, the wires are another: what is written puts the cells right."""
    rng = np.random.default_rng(4)
    wires, wrong = rng.permutation(16), tuple(int(i) for i in rng.permutation(16))
    save_sensor(SensorWiring(order=wrong, unit="V", full_scale=5.0), "palm.toml")
    assert run([*bench(tapped[:, np.argsort(wires)]), "--sensor-file", "palm.toml"]) == 0
    assert load_sensor("palm.toml").order == tuple(int(i) for i in wires)
    assert load_sensor("palm.toml").full_scale == 5.0


def test_a_dead_channel_is_a_reported_failure_and_an_uncertain_order_does_not_change_the_file(tapped, capsys):
    samples = tapped.copy()
    samples[:, 6] = 0
    assert run([*bench(samples), "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert (answer["dead"], answer["channel"][6], answer["sound"]) == ([6], None, False)
    assert answer["order"] == list(range(16))
    assert "channel 6 is dead" in answer["findings"][0]
    samples[:, 9] = 0
    save_sensor(SensorWiring(unit="V"), "palm.toml")
    assert run([*bench(samples), "--sensor-file", "palm.toml"]) == 1
    assert "not changed" in capsys.readouterr().err
    assert load_sensor("palm.toml").order == tuple(range(16))


def test_silence_is_one_clear_line(capsys):
    command = bench(np.random.default_rng(0).normal(0, 1e-3, (18_000, 16)))
    assert run(command) == 1
    assert "expected a response of at least one channel" in capsys.readouterr().err
