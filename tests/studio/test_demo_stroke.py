import numpy as np

from midair.studio.demo_stroke import KEPT, DemoStroke, demo_stroke
from midair.view import unpack


def test_stored_stroke_equals_the_sample():
    kept, made = DemoStroke.load(), demo_stroke()
    assert dict(kept.facts) == dict(made.facts)
    assert kept.streams.keys() == made.streams.keys()
    assert {stream for stream, _ in kept.streams} == {"samples", "wanted"}
    for key, data in kept.streams.items():
        for one, other in zip(unpack(data), unpack(made.streams[key]), strict=True):
            assert (one.first, one.kind, one.values.shape) == (other.first, other.kind, other.values.shape)
            # Another processor rounds otherwise.
            np.testing.assert_allclose(one.values * one.unit, other.values * other.unit, atol=1.5 * one.unit)


def test_it_is_small_and_simulated():
    assert KEPT.stat().st_size < 110_000
    assert DemoStroke.load().facts["simulated"]


def test_stroke_survives_saving_and_loading(tmp_path):
    made = DemoStroke(
        facts={"frames": 2}, streams={("samples", 0): b"\n\x00a", ("wanted", 0): b"", ("wanted", 1): b"z"}
    )
    made.save(tmp_path / "kept.xz")
    assert DemoStroke.load(tmp_path / "kept.xz") == made
