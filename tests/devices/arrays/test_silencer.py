"""Choice of the silencer with the least error of the pressure, for drives with a known answer."""

from dataclasses import replace

import numpy as np
import pytest
from tests.simulators.exposure_override import clear_any_exposure

from midair.devices import VirtualArray, VirtualSkin, autd3_array, choose_silencer
from midair.devices.arrays.silencer import Sampling, named_silencer, silencer_errors
from midair.errors import InputError
from midair.model import Drive, Placement, Provenance, TransducerArray
from midair.physics import PlaybackChain, TransducerDynamics, focus_phase
from midair.physics.sensing import SensorModel

ARRAY = TransducerArray.autd3(columns=1, rows=1)
FOCUS = focus_phase(ARRAY, np.array([0, 0, 0.2]))


def drive(phase, rate=1000.0, **others):
    phase = np.asarray(phase, float)
    return Drive(phase=phase, level=np.ones(len(phase)), rate=rate, array=ARRAY, **others)


def turning(degrees, frames=24, rate=1000.0):
    """A constant focus whose phases all turn back and forth together."""
    return drive(FOCUS + np.radians(degrees) * (np.arange(frames) % 2)[:, None], rate)


def jumping(frames=24):
    places = np.random.default_rng(0).uniform(-0.03, 0.03, (frames, 2))
    return drive([focus_phase(ARRAY, np.array([x, y, 0.2])) for x, y in places])


@pytest.mark.long
def test_a_constant_focus_has_no_error_and_needs_no_silencer():
    still = turning(0)
    assert max(silencer_errors(still).values()) < 1e-3
    assert choose_silencer("auto", still).phase == 0


def test_phases_that_turn_together_are_spread():
    """A sudden turn causes a dip of the sound; transducers follow a slower turn better."""
    errors = silencer_errors(turning(120))
    assert errors["off"] > errors["quarter"] > errors["half"] > errors["default"]
    assert choose_silencer("auto", turning(120)).phase == pytest.approx(1e-3)


def test_a_dip_is_worth_two_time_constants_of_silence():
    """The integral of 1 - (1 - 2 exp(-t / tau))^2 over a much longer frame, for phases that turn by half a turn."""
    error = silencer_errors(turning(180, rate=100.0), Sampling(before=1))["off"]
    assert error == pytest.approx(2 * TransducerDynamics().time_constant / 10e-3, rel=0.15)


def test_a_focus_that_jumps_is_not_spread():
    """An intermediate pattern resembles neither of the two positions."""
    errors = silencer_errors(jumping())
    assert errors["off"] < errors["quarter"] < errors["half"] < errors["default"]
    chosen = choose_silencer("auto", jumping())
    assert chosen.phase == 0
    assert f"least error; simulated error of the pressure: off {100 * errors['off']:.0f} %" in str(chosen)


def test_the_error_of_a_focus_that_turns_is_that_of_one_circuit():
    """All transducers alike: |q|^2 of one that follows its drive from -1 to 1, averaged over a frame."""
    dynamics = TransducerDynamics(detuning=0.0)
    tau, period, steps = dynamics.time_constant, 1e-3, 20
    # Settled from frame to frame: q(0) = -c q(T) for a drive that changes its sign each frame.
    at = np.arange(1, steps + 1) * period / steps
    start = -np.tanh(period / 2 / tau)
    power = (1 + (start - 1) * np.exp(-at / tau)) ** 2
    expected = abs(power.mean() - 1)
    found = silencer_errors(turning(180), Sampling(before=6))["off"]
    # The usual transducer is a little off its resonance, which turns what it radiates and changes its strength.
    assert found == pytest.approx(expected, abs=0.08)


def test_silence_has_no_error():
    quiet = replace(jumping(), level=np.zeros(24))
    assert set(silencer_errors(quiet).values()) == {0.0}
    assert choose_silencer("auto", quiet).phase == 0
    assert choose_silencer("auto", drive(FOCUS[None])).phase == 0


@pytest.mark.parametrize("rate", [100.0, 4000.0, 40e3])
def test_drives_of_any_rate_and_length_are_simulated(rate):
    errors = silencer_errors(replace(jumping(200), rate=rate))
    assert list(errors) == ["off", "quarter", "half", "default"]
    assert all(0 < one < 2 for one in errors.values())


@pytest.mark.long
def test_the_sample_tells_the_whole():
    whole = Sampling(windows=1, frames=400, moments=10_000)
    long = jumping(400)
    some, every = silencer_errors(long), silencer_errors(long, whole)
    for name, one in every.items():
        assert some[name] == pytest.approx(one, rel=0.25)


def test_it_is_looked_at_where_the_drive_was_solved_for():
    """Solved for 120 mm, where the pressure hardly changes; at 200 mm it would change."""
    said = drive(jumping().phase, provenance=Provenance().then("settings", {"target.grid.height": 0.12}))
    assert silencer_errors(said) != silencer_errors(jumping())


@pytest.mark.parametrize("rate", [100.0, 1000.0, 4000.0, 40e3])
@pytest.mark.parametrize("choice", ["quarter", "half"])
def test_a_step_is_complete_within_its_part_of_a_frame_or_in_the_shortest_time_there_is(rate, choice):
    chosen = named_silencer(choice, rate)
    assert 25e-6 <= chosen.phase <= max(25e-6, 0.5 / rate)
    assert chosen.phase <= 1e-3
    assert chosen.phase / 25e-6 == pytest.approx(round(chosen.phase / 25e-6))


def test_choices_by_name():
    assert choose_silencer("off", jumping()).phase == 0
    chosen = choose_silencer("default", jumping())
    assert (chosen.phase, chosen.intensity) == (1e-3, 0.25e-3)
    assert "as requested; simulated error of the pressure: off" in str(chosen)
    with pytest.raises(InputError, match="auto, off"):
        choose_silencer("loud", jumping())


@pytest.mark.long
@pytest.mark.parametrize("made", [turning(120), jumping()], ids=["turning", "jumping"])
def test_the_virtual_array_plays_with_what_a_real_one_would(made):
    pytest.importorskip("autd3")
    real = autd3_array("emulator", Placement.grid(columns=1, rows=1))
    virtual = VirtualArray(ARRAY, VirtualSkin(SensorModel()))
    told = []
    for array in (real, virtual):
        with array:
            told.append(array.play(clear_any_exposure(made, array)).silencer)
    assert told[0] == told[1] != ""


def test_a_virtual_array_made_ideal_has_no_silencer():
    ideal = VirtualArray(ARRAY, VirtualSkin(SensorModel()), chain=PlaybackChain(phase_bits=None, hold="ideal"))
    with ideal:
        assert ideal.play(clear_any_exposure(turning(180), ideal)).silencer == "off"
