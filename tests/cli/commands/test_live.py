"""The options of `midair live` are those of `LiveSettings`, and so are the defaults and limits of the studio's form."""

from types import SimpleNamespace

import pytest
from pydantic import ValidationError

from midair.cli.app import app
from midair.cli.commands.live import _session_lines
from midair.devices.arrays.silencer import Silencer
from midair.model import HEIGHTS, Acoustics, Medium, SensorGrid
from midair.rig import LiveSettings
from midair.settings import best_mode
from midair.studio.panels.live_panel import CheckLive
from midair.table import printed


def typed(words):
    """Settings that the command makes of a line."""
    _, bound, _ = app.parse_args(["live", *words])
    return bound.arguments["options"].settings()


def test_typed_values_become_settings():
    assert typed(["--seed", "0"]) == LiveSettings()
    assert LiveSettings().acoustics == best_mode().acoustics == Acoustics(medium=Medium.at(temperature=22.0))
    assert LiveSettings().exposure.room is None, "the assumed air of the processing is not that of the check"
    words = "--hold 4ms --band 20Hz 200Hz --height 150mm --temperature 25C --humidity 30%"
    known = typed(words.split())
    assert (known.hold, known.band, known.height) == (0.004, (20.0, 200.0), 0.15)
    assert known.acoustics.medium == known.exposure.room == Medium.at(temperature=25.0, humidity=0.3)


def test_an_exceeded_check_says_why_it_plays_all_the_same():
    opened = SimpleNamespace(
        **{"sensor": SensorGrid(), "rate": 1000.0, "transducers": 996, "silencer": Silencer(phase=0, intensity=0)},
        **{
            "array_calibration": "",
            "exposure": "exceeded: 166.4 dB at the palm",
            "level": 1.0,
            "error": (),
            "parts": (),
        },
        **{"granted": SimpleNamespace(words=str), "rehearsal": SimpleNamespace(words=str)},
    )
    session = SimpleNamespace(opened=opened, order=LiveSettings(), statistics=SimpleNamespace(parts={}))
    rows = dict(printed(_session_lines(session)))
    assert rows["exposure"].endswith("palm; it may play here: the array is simulated and emits no sound")
    assert rows["array"].endswith("silencer off"), "no empty brackets without a reason"
    opened.exposure = "kept: 90 dB"
    assert dict(printed(_session_lines(session)))["exposure"] == "kept: 90 dB"


def test_the_studio_takes_the_same_defaults_and_limits():
    form, own = CheckLive(sensor="virtual:towel"), LiveSettings()
    made = (1e-3 * form.delay_ms, 1e-3 * form.hold_ms, form.gain, 1e-3 * form.height_mm, form.level)
    assert form.mapping == own.mapping
    assert made == pytest.approx((own.delay, own.hold, own.gain, own.height, own.level))
    for wrong in ({"gain": 101}, {"level": 0}, {"height_mm": 1.01e3 * HEIGHTS[1]}, {"hold_ms": 21}):
        with pytest.raises(ValidationError):
            CheckLive(sensor="virtual:towel", **wrong)
