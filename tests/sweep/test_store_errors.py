"""An edited store gives a one-line error for every query."""

from dataclasses import replace

import pytest

from midair.errors import BrokenFileError
from midair.sweep.pattern_report import PatternResults, report_of, trial_report
from midair.sweep.pattern_sweep import PatternSweep

SWEEP = PatternSweep(count=8, curve_count=0, chunk=8, method="naive", strengths=(0.1,))


@pytest.fixture(scope="module")
def results(finished, tmp_path_factory):
    return finished(tmp_path_factory.mktemp("sweep") / "s.zarr", SWEEP)


@pytest.mark.parametrize(
    "change", [{"strengths": [[]]}, {"heights": ["a"]}, {"count": "n/a"}, {"x": 1}, {"acoustics": 3}], ids=str
)
def test_settings_of_patterns(change, results):
    with pytest.raises(BrokenFileError, match="expected settings and results of midair"):
        report_of(PatternResults.of(replace(results, settings={**results.settings, **change})))


@pytest.mark.parametrize(
    "settings", [{}, {"trials": 1}, {"trials": [1]}, {"trials": [{}]}, {"trials": [{}] * 9}], ids=str
)
def test_settings_of_recordings(settings, results):
    with pytest.raises(BrokenFileError, match="expected settings and results of midair"):
        trial_report(replace(results, kind="recordings", settings=settings))
