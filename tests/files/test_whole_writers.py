import ast
import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

SRC = Path(__file__).parents[2] / "src" / "midair"
PROGRAM = Path(__file__).with_name("half_writers.py")

ON_THEIR_OWN = {
    "cli/output.py": "an empty file that is held as a lock",
    "devices/safety/lock_files.py": "a file that is held while it is written, and whose content dies with its process",
    "devices/safety/play_log.py": "a log that grows line by line",
    "devices/safety/stop_channel.py": "written aside and moved there by itself",
    "study/session/event_log.py": "a log that grows line by line",
}
"""Files of src that write without `atomic_file`, and why."""


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
    assert len(found["refused"]) >= (13 if request.param else 16)
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


WRITES = {"write_text", "write_bytes", "to_csv", "savefig"}


def names_of_whole_files(tree):
    """Variables bound by `with atomic_file(...) as name` and similar."""
    return {
        item.optional_vars.id
        for node in ast.walk(tree)
        if isinstance(node, ast.With)
        for item in node.items
        if isinstance(item.context_expr, ast.Call)
        and ast.unparse(item.context_expr.func) in ("atomic_file", "atomic_folder")
        and isinstance(item.optional_vars, ast.Name)
    }


def written_by_hand(module):
    """Calls in a file of src that write to a path that is not from `atomic_file`; paths from arguments are accepted."""
    text = module.read_text(encoding="utf-8")
    if not any(f".{name}(" in text for name in (*WRITES, "open")):
        return
    tree = ast.parse(text)
    whole = names_of_whole_files(tree)
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        mode = [each.value for each in node.args[:1] if isinstance(each, ast.Constant)]
        opens = node.func.attr == "open" and any(re.fullmatch("[wxa][bt+]{0,2}", str(each)) for each in mode)
        if not (node.func.attr in WRITES or opens):
            continue
        target = node.func.value if node.func.attr != "to_csv" else node.args[0]
        named = {each.id for each in ast.walk(target) if isinstance(each, ast.Name)}
        if node.func.attr == "savefig" or named & whole:
            continue
        arguments = {
            each.arg
            for f in ast.walk(tree)
            if isinstance(f, ast.FunctionDef)
            if node in ast.walk(f)
            for each in f.args.args
        }
        if not (isinstance(target, ast.Name) and named <= arguments and whole):
            yield f"{module.relative_to(SRC).as_posix()}:{node.lineno}"


@pytest.mark.long
def test_all_files_in_src_are_written_atomically():
    found = [each for module in SRC.rglob("*.py") for each in written_by_hand(module)]
    assert [each for each in found if each.split(":")[0] not in ON_THEIR_OWN] == []
    assert {each.split(":")[0] for each in found} <= set(ON_THEIR_OWN)
