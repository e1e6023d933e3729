"""Stored modes: read back bit by bit, damaged ones ignored, bounded in size, removed by doctor."""

import numpy as np

from midair.cli.app import run
from midair.rig import ModeStore, clear_modes
from midair.rig.bench import mode_store


def test_arrays_come_back_and_damaged_ones_do_not():
    store, arrays = ModeStore(), {"s": np.arange(9.0), "V": np.ones((2, 3), complex)}
    assert store.read("a") is None
    store.write("a", arrays)
    found = store.read("a")
    assert found is not None
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
    path = mode_store._folder() / "a.npz"
    damaged = bytearray(path.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    path.write_bytes(bytes(damaged))
    assert store.read("a") is None
    path.write_bytes(b"short")
    assert store.read("a") is None


def test_the_oldest_are_removed_and_all_can_be(monkeypatch, capsys):
    monkeypatch.setattr(mode_store, "MOST", 20_000)
    store = ModeStore()
    for name in "abc":
        store.write(name, {"x": np.zeros(1000)})
    assert [store.read(name) is None for name in "abc"] == [True, False, False]
    assert run(["doctor", "--clear-cache"]) == 0
    assert "of stored modes" in capsys.readouterr().out
    assert clear_modes() == 0
