import json
import math

import pytest

from midair.errors import BrokenFileError, InputError
from midair.files.native.provenance_json import from_json, to_json
from midair.model import Provenance


def test_keeps_every_type(provenance):
    again = from_json(to_json(provenance))
    assert again == provenance
    settings = again.steps[0].settings
    assert isinstance(settings["n"], int)
    assert settings["on"] is True
    assert settings["deep"] == ("a", (1, 2.5))
    assert isinstance(settings["band"], tuple)
    life = Provenance().then("limit", {"high": math.inf, "low": -math.inf, "none": math.nan})
    text = to_json(life)
    json.loads(text, parse_constant=pytest.fail)
    settings = from_json(text).steps[0].settings
    assert settings["high"] == math.inf
    assert settings["low"] == -math.inf
    assert math.isnan(settings["none"])


def test_refuses_a_setting_that_json_would_change():
    with pytest.raises(InputError, match=r"setting grid: .* got list"):
        to_json(Provenance().then("solve", {"grid": [1, 2]}))


def test_refuses_other_text():
    for text in (
        "",
        "[]",
        "{}",
        '{"source": 3, "simulated": false, "notes": {}, "steps": []}',
        '{"source": "a", "simulated": 0, "notes": {}, "steps": []}',
        '{"source": "a", "simulated": false, "notes": {"b": 1}, "steps": []}',
        '{"source": "a", "simulated": false, "notes": {}, "steps": {}}',
        '{"source": "a", "simulated": false, "notes": {}, "steps": [{"stage": "a"}]}',
        '{"source": "a", "simulated": false, "notes": {}, "steps": [{"stage": "a", "settings": {"b": {"c": 1}}}]}',
        "[" * 100_000,
    ):
        with pytest.raises(BrokenFileError):
            from_json(text)
