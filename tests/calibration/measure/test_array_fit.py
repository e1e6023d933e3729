"""Blind measurement of transducers: only the simulation knows the true array."""

from dataclasses import dataclass

import numpy as np
import pytest
from tests.calibration.measure.test_unit_poses import ROOM, measured

from midair.calibration import ArrayField, ArrayPlan, array_codes, fit_array
from midair.errors import InputError, ShapeError
from midair.model import TransducerArray
from midair.physics import SensorModel, Transducers, calibration_of


@dataclass(frozen=True)
class Secret:
    array: TransducerArray
    transducers: Transducers
    dead: np.ndarray

    @property
    def response(self):
        """Without the common phase, which has no effect."""
        return self.transducers.response * np.exp(-1j * np.angle(self.transducers.response[~self.dead].sum()))


def secret(count, *, seed, dead=1):
    whole = TransducerArray.autd3(columns=1, rows=1)
    rng = np.random.default_rng((seed, 1))
    near = np.sort(np.argsort(np.linalg.norm(whole.position, axis=1))[:count])
    array = TransducerArray(position=whole.position[near], normal=whole.normal[near], name=f"secret {seed}")
    drawn = Transducers.varied(count, seed=seed, gain=0.9, gain_spread=0.05, resonance_spread=50, quality_spread=0.05)
    off = np.isin(np.arange(count), rng.permutation(count)[:dead])
    late = np.exp(0.05j * rng.standard_normal(count))
    return Secret(array, Transducers(pole=drawn.pole, response=np.where(off, 0, drawn.response * late)), off)


def fitted(known, plan, **how):
    return measured(known.array, known.transducers, np.zeros((1, 7)), plan=plan, **how)


def scores(found, known):
    """Errors over standard uncertainties of live transducers by name, without the common level."""
    alive = ~known.dead
    level = found.strength[alive].mean() / np.abs(known.response[alive]).mean()
    pole = known.transducers.pole
    resonance = 40e3 + pole.imag / (2 * np.pi)
    errors = {
        "strength": found.strength / level - np.abs(known.response),
        "phase": np.angle(found.response * known.response.conj() + known.dead),
        "resonance": found.resonance - resonance,
        "quality": found.quality / (-np.pi * resonance / pole.real) - 1,
    }
    return {name: (error / getattr(found, f"{name}_uncertainty"))[alive] for name, error in errors.items()} | {
        "level": np.array([(level - 1) / max(found.level_uncertainty, 1e-9)])
    }


@pytest.mark.long
def test_most_differences_of_a_few_transducers_are_measured():
    known = secret(40, seed=2)
    found = fitted(known, ArrayPlan(duration=0.5, group=20), seed=2, noise=1e-7)
    np.testing.assert_array_equal(found.dead, known.dead)
    assert (found.response[known.dead] == 0).all()
    alive = ~known.dead
    level = found.strength[alive].mean() / np.abs(known.response[alive]).mean()
    left = (found.response / level - known.response)[alive]
    assert np.std(left) < 0.35 * np.std(known.response[alive])
    pole = known.transducers.pole
    assert np.std((found.pole - pole).imag[alive]) < 0.3 * np.std(pole.imag)
    assert np.std((found.pole - pole).real[alive]) < 0.6 * np.std(pole.real)


@pytest.mark.slow
@pytest.mark.parametrize("away", [(0.0, 0.0, 0.2), (0.6e-3, -0.4e-3, 0.2008)], ids=["in place", "beside"])
def test_uncertainties_hold_for_95_percent(away):
    found = {}
    for seed in range(3):
        known = secret(120, seed=seed, dead=2)
        calibration = fitted(known, ArrayPlan(duration=2.0, group=60), seed=seed, noise=1e-6, away=away)
        np.testing.assert_array_equal(calibration.dead, known.dead)
        for name, score in scores(calibration, known).items():
            found.setdefault(name, []).extend(score)
    shares = {name: float((np.abs(score) < 2).mean()) for name, score in found.items()}
    for name in ("strength", "phase", "resonance", "quality"):
        assert shares[name] > 0.93, shares


@pytest.mark.long
def test_a_recording_without_the_beam_is_rejected():
    known, model = secret(8, seed=0), SensorModel()
    codes = array_codes(known.array, model.grid, ArrayPlan(duration=0.2), acoustics=ROOM, height=0.2)
    field = ArrayField(array=known.array, codes=codes, acoustics=ROOM, calibration=calibration_of(model))
    noise = np.random.default_rng(0).standard_normal((codes.frames, 16))
    with pytest.raises(InputError, match="recording that the model explains"):
        fit_array(field, noise)
    with pytest.raises(ShapeError, match="frames of codes or more"):
        fit_array(field, noise[:100])


def test_the_first_group_begins_after_the_sensor_has_settled():
    codes = array_codes(
        secret(8, seed=0).array, SensorModel().grid, ArrayPlan(duration=0.4, group=4), acoustics=ROOM, height=0.2
    )
    assert codes.starts == (300, 650)
    assert codes.frames == 1000
    phase = codes.phase
    assert (phase[:300] == codes.still).all()
    np.testing.assert_allclose(
        phase[300:500, codes.groups[0]] - codes.still[codes.groups[0]], codes.codes[0] * np.pi / 2, atol=1e-12
    )
