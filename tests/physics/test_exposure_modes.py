"""The field computed from modes equals the field at all points, for any slowly changing field."""

import numpy as np

from midair.physics.exposure_modes import Product, Workspace, field_by_modes, stacks

WIDE = np.array([3.0, 5.0, 2.5])


def waves(share):
    """One plane wave for each of 300 transducers, within the bands."""
    rng = np.random.default_rng(1)
    return np.exp(1j * share @ (rng.uniform(-1, 1, (3, 300)) * WIDE[:, None])).astype(np.complex64)


def test_the_loudest_point_by_modes_is_that_of_the_field():
    where = stacks(WIDE, inside=1.6, faces=1.0)
    heard = field_by_modes((waves,), WIDE, where, 1e-3 * 300, step=1.6, tried=160)
    q = np.exp(1j * np.random.default_rng(2).uniform(0, 2 * np.pi, (70, 300)))
    true = np.abs(q @ waves(np.concatenate([each.points.reshape(-1, 3) for each in where])).T).max(axis=1)
    parts = np.stack([q.real, q.imag, q.real + q.imag]).astype(np.float32)
    space, modes = Workspace(), np.empty((3, 70, len(heard.modes)), np.float32)
    Product.of(heard.modes.T).into(modes, parts, space)
    modes[2] = modes[0] + modes[1]
    np.testing.assert_allclose(heard.loudest(modes, space)[0], true, atol=heard.left_out)
    assert heard.left_out < 5e-3 * 300
