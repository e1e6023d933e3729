"""All ways in which a playing studio can end; the emulated units measure the time until silence."""

import shutil

import pytest

pytestmark = pytest.mark.browser

AT_ONCE = (
    "STOP pressed",
    "tab hidden behind another",
    "window minimized",
    "tab closed",
    "server halted, STOP pressed",
    "server killed",
)
"""A process is left that requests silence."""

BY_DEADLINE = ("script hangs", "player halted", "cable to the array cut")
"""Half a second ends the others. `python -m benchmarks.studio --part deaths` has more of both."""


def test_array_is_silent_in_time_after_any_failure():
    if shutil.which("chromium") is None:
        pytest.skip("no chromium: apt-get install chromium")
    pytest.importorskip("autd3")
    from benchmarks.studio_deaths import DEATHS, deaths

    names = [name for name in DEATHS if name in AT_ONCE + BY_DEADLINE]
    found = deaths(names, say=str)
    assert len(found) == len(AT_ONCE) + len(BY_DEADLINE)
    # Half a second plus the delay of a busy machine; the benchmark has the figures.
    assert {name: took for name, (took, _) in found.items() if took > 2.0} == {}
    assert {name: by for name, (_, by) in found.items() if name in AT_ONCE and "order" not in by} == {}
