"""Three real products give the complex product, and arrays are reused."""

import numpy as np

from midair.physics.exposure_search.exposure_products import Product, Workspace, power_of


def random(*shape):
    rng = np.random.default_rng(0)
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64)


def test_three_real_products_are_the_complex_one():
    drive, matrix = random(5, 7), random(7, 4)
    found = np.empty((2, 5, 4), np.float32)
    parts = np.stack([drive.real, drive.imag, drive.real + drive.imag])
    Product.of(matrix).into(found, parts, Workspace())
    np.testing.assert_allclose(found[0] + 1j * found[1], drive @ matrix, atol=1e-5)


def test_an_array_of_a_name_is_the_same_memory_again():
    space = Workspace()
    first = space.array("a", 3, 4)
    assert np.shares_memory(space.array("a", 2, 4), first)
    assert not np.shares_memory(space.array("b", 3, 4), first)
    assert space.array("a", 9, 4).shape == (9, 4)


def test_the_power_at_some_points():
    there = np.array([[[3, 0, 0], [1, 1, 0]], [[4, 0, 2], [1, 0, -1]]], np.float32)
    np.testing.assert_allclose(power_of(there), [[25, 0, 4], [2, 1, 1]])
