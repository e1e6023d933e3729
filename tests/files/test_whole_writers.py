import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

SRC = Path(__file__).parents[2] / "src" / "midair"
PROGRAM = Path(__file__).with_name("half_writers.py")


@pytest.fixture(
    scope="module", params=[pytest.param("quick", marks=pytest.mark.long), pytest.param("", marks=pytest.mark.slow)]
)
def stopped(request, tmp_path_factory):
    """Files left by each writer, by the way it was stopped."""
    words = [sys.executable, PROGRAM, *request.param.split()]
    folder = tmp_path_factory.mktemp("writers")
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=folder, timeout=500)
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stdout.splitlines() if line[:1] == "{"]
    found = {how: {line["name"]: line for line in told if line["how"] == how} for how in ("refused", "killed")}
    assert len(found["refused"]) >= (13 if request.param else 15)
    assert set(found["refused"]) == set(found["killed"])
    return found


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits the size of no file")
@pytest.mark.parametrize("how", ["killed", "refused"])
def test_an_interrupted_writer_keeps_the_old_file(how, stopped):
    found = stopped[how]
    ended = -signal.SIGXFSZ if how == "killed" else 1
    assert {name: line["ended"] for name, line in found.items()} == dict.fromkeys(found, ended)
    assert [name for name, line in found.items() if not line["whole"]] == []
    # A writer that fails removes its temporary file; a killed one leaves a hidden file that no reader accepts.
    assert how == "killed" or [name for name, line in found.items() if line["left"]] == []
    assert [name for name, line in found.items() if line["again"] not in (False, 0)] == []


def test_files_in_src_are_written_by_those_that_write_them_whole():
    writes = re.compile(r"""\.(write_text|write_bytes|to_csv|savefig)\(|open\(["'][wxa]""")
    texts = {path.relative_to(SRC).as_posix(): path.read_text(encoding="utf-8") for path in SRC.rglob("*.py")}
    by_hand = {name for name, text in texts.items() if writes.search(text) and "atomic_" not in text}
    logs = {"study/session/event_log.py", "devices/safety/play_log.py"}
    held = {"devices/safety/lock_files.py", "devices/safety/stop_channel.py", "cli/output.py"}
    in_memory = {"figures/style.py"}
    assert by_hand <= logs | held | in_memory
