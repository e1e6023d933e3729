from types import SimpleNamespace

import numpy as np

from midair.model import Drive, TransducerArray
from midair.physics.exposure_modes import Product, Workspace, drive_parts, power_of


def random(*shape):
    rng = np.random.default_rng(0)
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64)


def test_products_in_real_parts_in_memory_that_is_kept():
    drive, matrix = random(5, 7), random(7, 4)
    found = np.empty((2, 5, 4), np.float32)
    parts = np.stack([drive.real, drive.imag, drive.real + drive.imag])
    Product.of(matrix).into(found, parts, Workspace())
    np.testing.assert_allclose(found[0] + 1j * found[1], drive @ matrix, atol=1e-5)
    space = Workspace()
    first = space.array("a", 3, 4)
    assert np.shares_memory(space.array("a", 2, 4), first)
    assert not np.shares_memory(space.array("b", 3, 4), first)
    assert space.array("a", 9, 4).shape == (9, 4)
    there = np.array([[[3, 0, 0], [1, 1, 0]], [[4, 0, 2], [1, 0, -1]]], np.float32)
    np.testing.assert_allclose(power_of(there), [[25, 0, 4], [2, 1, 1]])


ARRAY = TransducerArray.autd3(columns=1, rows=1)
RNG = np.random.default_rng(0)


def drive(phase, level):
    return Drive(phase=phase, level=level, rate=1000.0, array=ARRAY)


def test_levels_are_in_the_parts_whatever_the_turns_of_a_phase():
    for turns, atol in ((0, 1e-6), (10**7, 1e-5)):
        phase = RNG.uniform(-9, 9, (7, ARRAY.count)) + 2 * np.pi * turns
        for level in (RNG.random((7, ARRAY.count)), RNG.random(7)):
            told = drive(phase, level)
            parts, highest = drive_parts(told, slice(2, 6), Workspace())
            true = told.q[2:6]
            expected = [true.real, true.imag, true.real + true.imag]
            np.testing.assert_allclose(parts, expected, atol=atol, err_msg=f"{turns} turns, {level.shape}")
            np.testing.assert_array_equal(highest, level[2:6].reshape(4, -1).max(axis=1))
    parts, _ = drive_parts(drive(np.full((1, ARRAY.count), 1e300), np.ones(1)), slice(None), Workspace())
    np.testing.assert_allclose(parts[0], np.cos(np.remainder(1e300, 2 * np.pi)), atol=1e-6)


def test_nan_phases_stay_nan():
    """A drive rejects NaN; if one passes nevertheless, it must not count as silence."""
    said = SimpleNamespace(phase=np.full((1, 3), np.nan), level=np.ones(1))
    assert np.isnan(drive_parts(said, slice(None), Workspace())[0]).all()
