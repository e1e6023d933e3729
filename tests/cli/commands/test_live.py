"""The options of `midair live` are those of `LiveSettings`, and so are the defaults and limits of the studio's form."""

import pytest
from pydantic import ValidationError

from midair.cli.app import app
from midair.model import HEIGHTS, Medium
from midair.rig import LiveSettings
from midair.studio.panels.live_panel import CheckLive


def typed(words):
    """Settings that the command makes of a line."""
    _, bound, _ = app.parse_args(["live", *words])
    return bound.arguments["options"].settings()


def test_typed_values_become_settings():
    assert typed(["--seed", "0"]) == LiveSettings()
    words = "--hold 4ms --band 20Hz 200Hz --height 150mm --temperature 25C --humidity 30%"
    known = typed(words.split())
    assert (known.hold, known.band, known.height) == (0.004, (20.0, 200.0), 0.15)
    assert known.acoustics.medium == known.exposure.room == Medium.at(temperature=25.0, humidity=0.3)


def test_the_studio_takes_the_same_defaults_and_limits():
    form, own = CheckLive(sensor="virtual:towel"), LiveSettings()
    made = (1e-3 * form.delay_ms, 1e-3 * form.hold_ms, form.gain, 1e-3 * form.height_mm, form.level)
    assert form.mapping == own.mapping
    assert made == pytest.approx((own.delay, own.hold, own.gain, own.height, own.level))
    for wrong in ({"gain": 101}, {"level": 0}, {"height_mm": 1.01e3 * HEIGHTS[1]}, {"hold_ms": 21}):
        with pytest.raises(ValidationError):
            CheckLive(sensor="virtual:towel", **wrong)
