"""Pairing of a re-recording with its original."""

import numpy as np

from midair.cli.terminal.compare_inputs import calibrated_part
from midair.evaluate import advance, compare
from midair.files import open_take, save
from midair.model import Provenance, Recording
from midair.rig import aligned_pair
from midair.settings import Settings
from midair.targets import add_lead


def test_a_delay_of_a_perfect_chain_costs_nothing(tmp_path):
    """300 us of delay: cut out first and moved then, its ends would be lost."""
    rng, settings = np.random.default_rng(4), Settings().but(band=(20.0, 470.0))
    life = Provenance(source="bench")
    save(Recording(samples=rng.normal(0, 5, (300, 4, 4)), rate=1000.0, unit="Pa", provenance=life), tmp_path / "a.h5")
    original = calibrated_part(tmp_path / "a.h5", settings)
    asked = add_lead(original, 0.1)
    for delay in (-0.0003, 0.0, 0.0003):
        played = life.then("lead", {"lead_s": 0.1}).then("play", {"rate_hz": 1000.0})
        heard = advance(np.asarray(asked.pressure), -delay, 1000.0)
        (again := tmp_path / "b.h5").unlink(missing_ok=True)
        save(Recording(samples=heard, rate=1000.0, unit="Pa", provenance=played), again)
        pair = aligned_pair(original, open_take(again), settings)
        assert pair.piece.frames == pair.original.frames == 300
        found = compare(pair.original, pair.heard, first=pair.first)
        assert abs(found.delay - delay) < 5e-5
        assert found.waveform_error < 0.002, delay
