"""Commands take the memory of a block, however long the recording or the drive is."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

MOST = 40.0
"""MB that a peak may grow by from 5 to 25 s: in memory 16 channels at 48 kHz grow by 61 MB, or 123 in float64.

`compare` takes spectra of 33 s at once, and not more.
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux says VmHWM")
def test_no_command_grows_with_the_length(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(Path(__file__).parents[2])
    memory, peaks = import_module("benchmarks.memory"), {}
    for seconds in (5, 25):
        (folder := tmp_path / str(seconds)).mkdir()
        monkeypatch.chdir(folder)
        monkeypatch.setitem(memory._ENV, "MIDAIR_STATE", str(folder / "state"))
        memory.make_all(seconds)
        for name, words in memory.commands(seconds):
            peak, _, status = memory.weighed(words)
            assert status == 0, (name, (folder / "said.txt").read_text()[-500:])
            peaks.setdefault(name, []).append(peak)
    with capsys.disabled():
        print(
            "".join(f"\n{name}: {early:.0f} MB of 5 s, {late:.0f} MB of 25 s" for name, (early, late) in peaks.items())
        )
    grown = {name: late - early for name, (early, late) in peaks.items() if late - early > MOST}
    assert grown == {}
    assert max(late for _, late in peaks.values()) < 400
