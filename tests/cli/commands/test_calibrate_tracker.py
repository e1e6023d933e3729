"""`midair calibrate tracker` to its end: a hand that goes where the command says, seen by a tracker over its socket."""

import re
from contextlib import closing

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.devices.trackers.test_tracker_contract import Osc
from tests.simulators.moving_hand import Hand

from midair.cli.app import run
from midair.cli.commands.calibrate import tracker as command
from midair.files import load_tracker


@pytest.mark.long
def test_it_writes_the_placement_of_a_tracker_whose_hand_goes_where_it_says(monkeypatch, tmp_path, capsys) -> None:
    turn, offset = Rotation.from_euler("xyz", [0, 5, 175], degrees=True).as_matrix(), np.array([0.0, -0.1, 0.01])
    rng, place, said = np.random.default_rng(1), [np.zeros(3)], command.print_note

    def told(text: str) -> None:
        said(text)
        numbers = re.search(r"\((\S+), (\S+), (\S+)\) mm", text).groups()
        place[0] = 1e-3 * np.array([float(each) for each in numbers])

    monkeypatch.setattr(command, "print_note", told)
    # The virtual array plays at once; a palm must be still for a second.
    monkeypatch.setattr("midair.rig.bench.tracker_bench.ROUND", 0.02)
    monkeypatch.setattr("midair.rig.bench.tracker_bench.ROUNDS", 1000)

    def there(values, stamp, _):
        centre = (place[0] + rng.normal(0, 2e-4, 3) - offset) @ turn
        return np.r_[centre, 0, 0, -1, 0, 1, 0], stamp, 1.0

    with closing(Osc()) as sender, Hand(sender, there, lasts=np.inf) as hand:
        hand.wrong_at = 0.0
        assert run(["calibrate", "tracker", sender.name, str(tmp_path / "palm.toml")]) == 0
    out, err = capsys.readouterr()
    assert "SIMULATED" in out + err
    assert "place 4 of 4" in err
    found = load_tracker(tmp_path / "palm.toml")
    np.testing.assert_allclose(found.offset, offset, atol=2e-3)
    np.testing.assert_allclose(found.rotation, turn, atol=0.02)
