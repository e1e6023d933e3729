"""The house itself: rooms that one can take in, one name for one thing, and tests where they are looked for."""

import ast
import re
import tomllib
from collections import Counter, defaultdict
from functools import cache
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[1]
SRC, TESTS = ROOT / "src" / "midair", ROOT / "tests"

SAME_NAME = {
    "live": "the command `live`, and the solver that it needs",
    "edit": "the command `edit`, and what it does to a recording",
    "identify": "the command `identify`, and what it does on the bench",
    "patterns": "the command `sweep patterns`, and the patterns of the paper's experiment",
}
"""Module names that stand twice, and why."""

WHOLE_SUITES = {
    "calibration/measure/test_blind.py": "all ways to measure, on a bench whose sensor they do not know",
    "cli/commands/test_play_arrays.py": "the command play on each kind of array",
    "cli/commands/test_play_openmpd.py": "solve, play, stop and doctor on the boards of a second maker",
    "cli/commands/test_solve_terms.py": "the command solve with each term",
    "cli/test_flat_memory.py": "what each command takes of the memory",
    "cli/test_commands.py": "the whole loop by commands, and what all commands have in common",
    "cli/test_mistakes.py": "what people type wrong, at every command",
    "cli/test_quota.py": "every writer on a disk with a quota",
    "cli/test_interrupts.py": "Ctrl-C at the last moment of every command that writes",
    "cli/test_help.py": "the help and the examples of every command",
    "devices/sensors/test_sensor_contract.py": "one contract, each kind of sensor",
    "devices/test_contract.py": "one contract, each kind of array",
    "devices/test_stopping.py": "silence at any moment, from arrays to the command stop",
    "files/test_mutations.py": "damaged files of every format",
    "files/test_structured_fuzz.py": "files of every kind, damaged with knowledge of their structure",
    "test_benchmarks.py": "the benchmarks",
    "test_bench_gpu.py": "`make bench-gpu`, where there is no GPU",
    "test_docs.py": "README and the pages of docs",
    "test_docs_blocks.py": "README and the pages of docs",
    "test_docs_network.py": "docs/network.py",
    "cli/test_long_work.py": "a bar and Ctrl-C, at every command",
    "test_reference.py": "what the reference names",
    "test_regression.py": "the recorder of figures",
    "files/test_whole_writers.py": "every writer, killed or refused in the middle",
    "files/test_one_way_in.py": "every format and every command that opens one",
    "files/test_real_recordings.py": "files that other programs wrote",
    "paper/test_paper.py": "the paper's figures made again, with few points",
    "rig/live_touch/test_live_outside.py": "live touch from a sensor's line to the wire, and its deaths",
    "rig/takes/test_crash.py": "a recorder that is killed at any moment",
    "rig/takes/test_take_memory.py": "a long take in little memory",
    "solvers/test_contract.py": "one contract, each solver and each known problem",
    "study/test_planned_power.py": "the power that a plan tells, and how often its report finds the effect",
    "study/test_kills.py": "new, run, analyse and export, killed at any moment",
    "study/statistics/test_type_one_error.py": "every test of significance, on data without an effect",
    "studio/test_deaths.py": "whatever ends a studio that plays, by the word of its units",
    "studio/test_faulty_sensor.py": "a sensor with faults, on the page and in the file",
    "studio/test_browser.py": "the studio in a real browser: playing, silence, who may speak to it",
    "studio/test_rooms.py": "the rooms in a real browser, and that everybody can use them",
    "studio/test_live_page.py": "the room Live in a real browser",
    "studio/test_live_room.py": "the room Live without its process",
    "test_examples.py": "the examples",
    "test_house.py": "this file",
    "test_main.py": "`python -m midair`",
    "test_midair.py": "the face of the package",
    "test_wheel.py": "the package as it is installed",
}
"""Tests of more than one file of src, and of what."""

UNTESTED_BY_NAME = {
    "calibration/measure/array_field.py": "calibration/measure/test_array_fit.py",
    "calibration/measure/array_place.py": "calibration/measure/test_array_fit.py",
    "calibration/measure/array_plan.py": "calibration/measure/test_array_fit.py",
    "calibration/measure/beam_plan.py": "calibration/measure/test_beam.py",
    "calibration/measure/evidence.py": "calibration/measure/test_against_reference.py",
    "cli/commands/budget.py": "cli/commands/test_loop.py",
    "cli/commands/calibrate/measure.py": "cli/commands/calibrate/test_apply.py",
    "cli/commands/demo.py": "cli/test_commands.py",
    "cli/commands/exposure.py": "cli/commands/test_play_arrays.py",
    "cli/commands/solve_play.py": "cli/commands/test_play_arrays.py",
    "cli/commands/study/numbers.py": "cli/commands/study/test_study.py",
    "cli/commands/study/planning.py": "cli/commands/study/test_study.py",
    "cli/commands/stop.py": "cli/commands/test_play_arrays.py",
    "cli/commands/sweep/recordings.py": "cli/commands/sweep/test_patterns.py",
    "cli/terminal/calibration_output.py": "cli/commands/calibrate/test_apply.py",
    "cli/terminal/play_options.py": "cli/commands/test_play_arrays.py",
    "cli/terminal/take_output.py": "cli/terminal/test_stage_options.py",
    "cli/terminal/rows.py": "cli/commands/test_info.py",
    "cli/terminal/sweep_output.py": "cli/commands/sweep/test_patterns.py",
    "devices/arrays/autd3_commands.py": "devices/arrays/test_autd3_emulator.py",
    "devices/arrays/banked_array.py": "devices/arrays/test_autd3_emulator.py",
    "devices/arrays/immediate.py": "devices/arrays/test_autd3_single_frames.py",
    "devices/arrays/streaming.py": "devices/arrays/test_autd3_emulator.py",
    "devices/virtual/virtual_units.py": "devices/test_contract.py",
    "devices/interface.py": "devices/test_contract.py",
    "devices/safety/held_files.py": "devices/safety/test_device_locks.py",
    "devices/safety/orders.py": "devices/test_stopping.py",
    "testing/behind_pty.py": "testing/test_openmpd_stand_in.py",
    "testing/udp_tap.py": "devices/arrays/test_autd3_udp.py",
    "paper/figure3.py": "paper/test_paper.py",
    "paper/figure4.py": "paper/test_paper.py",
    "paper/figure9.py": "paper/test_paper.py",
    "paper/modes_compared.py": "paper/test_paper.py",
    "rig/bench/practice.py": "cli/commands/calibrate/test_apply.py",
    "cli/commands/live.py": "rig/live_touch/test_session.py",
    "rig/live_touch/live_order.py": "rig/live_touch/test_session.py",
    "rig/live_touch/playing_live.py": "rig/live_touch/test_session.py",
    "rig/live_touch/speaking.py": "rig/live_touch/test_listening.py",
    "rig/looping/passes.py": "rig/looping/test_iteration.py",
    "rig/names/virtual_rig.py": "rig/names/test_source_names.py",
    "rig/takes/take_plan.py": "rig/takes/test_take.py",
    "solvers/live/live_kernel.py": "solvers/live/test_live.py",
    "study/design/analysis_plan.py": "study/session/test_steps.py",
    "study/design/answers.py": "study/design/test_plan.py",
    "study/design/exclusions.py": "study/session/test_steps.py",
    "study/design/ladder.py": "study/design/test_adaptive_block.py",
    "study/design/stimulus.py": "study/design/test_blocks.py",
    "study/design/study_design.py": "study/design/test_blocks.py",
    "study/findings/choice_findings.py": "study/findings/test_analysis.py",
    "study/findings/rating_findings.py": "study/findings/test_analysis.py",
    "study/statistics/logistic.py": "study/statistics/test_mixed.py",
    "study/statistics/psychometric_fit.py": "study/statistics/test_psychometric.py",
    "study/statistics/psychometric_profile.py": "study/statistics/test_psychometric.py",
    "study/statistics/sphericity.py": "study/statistics/test_anova.py",
    "study/session/simulated_screen.py": "study/session/test_participant.py",
    "study/stimulus_rig.py": "cli/commands/study/test_study.py",
    "studio/desk.py": "studio/test_application.py",
    "studio/sensor_process.py": "studio/test_browser.py",
    "studio/player.py": "studio/test_browser.py",
    "studio/rooms/calibrate_room.py": "studio/test_rooms.py",
    "studio/rooms/study_room.py": "studio/test_rooms.py",
    "studio/rooms/compare_room.py": "studio/test_application.py",
    "studio/rooms/live_room.py": "studio/test_live_room.py",
    "studio/rooms/playing_room.py": "studio/test_application.py",
    "studio/rooms/record_room.py": "studio/test_application.py",
    "studio/rooms/reproduce_room.py": "studio/test_application.py",
    "studio/takes_list.py": "studio/test_application.py",
    "study/terminal_screen.py": "cli/commands/study/test_study.py",
}
"""Files of src without a test file of their own name, and the one that tests them all the same."""

WORTH_A_TEST = 15
"""Lines of code up to which a file may do without a test file of its own name."""

LEFT_OUT_OF_ALL = {
    "autd3-emulator": "an array to try things on",
    "pyautd3": "the SDK of older firmware, whose version hangs on that of Python",
    "gpu-torch": "a GPU",
    "gpu-cupy": "a GPU of one vendor",
    "all": "itself",
    **dict.fromkeys(["test", "check", "docs", "bench", "dev"], "for those who work on midair"),
}
"""Extras that `midair[all]` does not bring, and why."""


@cache
def modules():
    return sorted(path.relative_to(SRC) for path in SRC.rglob("*.py"))


@cache
def tree(module):
    return ast.parse((SRC / module).read_text(encoding="utf-8"))


def test_no_folder_has_more_than_twenty_files():
    sizes = Counter(str(module.parent) for module in modules())
    assert {folder: size for folder, size in sizes.items() if size > 20} == {}


def test_no_room_is_larger_than_fifteen_hundredths_of_the_house():
    lines = Counter[str]()
    for module in modules():
        lines[module.parts[0]] += len((SRC / module).read_text(encoding="utf-8").splitlines())
    shares = {room: size / lines.total() for room, size in lines.items()}
    assert {room: f"{share:.1%}" for room, share in shares.items() if share >= 0.15} == {}


def test_no_two_modules_have_one_name():
    places = defaultdict(list)
    for module in modules():
        if module.stem not in ("__init__", "__main__"):
            places[module.stem].append(str(module))
    twice = {name: where for name, where in places.items() if len(where) > 1}
    assert {name: where for name, where in twice.items() if name not in SAME_NAME} == {}
    assert set(SAME_NAME) - set(twice) == set(), "these stand once now: take them out of SAME_NAME"


def test_no_two_classes_have_one_name():
    places = defaultdict(list)
    for module in modules():
        for node in ast.walk(tree(module)):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(f"{module}:{node.lineno}")
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


def test_every_test_file_lies_where_its_subject_does():
    astray = []
    for path in TESTS.rglob("test_*.py"):
        place = path.relative_to(TESTS)
        subject = SRC / place.parent / place.stem.removeprefix("test_")
        if place.as_posix() not in WHOLE_SUITES and not subject.with_suffix(".py").exists() and not subject.is_dir():
            astray.append(place.as_posix())
    assert sorted(astray) == []


def test_the_list_of_whole_suites_is_true():
    assert [name for name in WHOLE_SUITES if not (TESTS / name).exists()] == []


@cache
def lines_of_code(module):
    """Lines on which a statement stands, without docstrings, imports and re-exports."""
    lines = set()
    for node in ast.walk(tree(module)):
        text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node, ast.stmt) and not text and not isinstance(node, ast.Import | ast.ImportFrom):
            end = node.lineno if hasattr(node, "body") else node.end_lineno
            lines |= set(range(node.lineno, end + 1))
    return len(lines)


def test_every_file_of_some_size_has_a_test_file_of_its_name():
    missing = [
        module.as_posix()
        for module in modules()
        if module.stem != "__init__"
        and lines_of_code(module) > WORTH_A_TEST
        and not (TESTS / module.parent / f"test_{module.name}").exists()
        and module.as_posix() not in UNTESTED_BY_NAME
    ]
    assert missing == [], "write a test file of that name, or say in UNTESTED_BY_NAME which one tests it"


PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "decisions").glob("*.md")),
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_files_that_a_page_names_are_there(page):
    text = page.read_text(encoding="utf-8")
    named = set(
        re.findall(r"(?<![\w./])((?:[a-z_0-9]+/)+[a-zA-Z_0-9-]*(?:\.py|\.toml|/)|[a-z_0-9]+\.py)(?=[`\s,;:)])", text)
    )
    roots = (ROOT, SRC, SRC.parent, page.parent)
    assert sorted(name for name in named if not any((root / name).exists() for root in roots)) == []


@pytest.mark.parametrize("module", UNTESTED_BY_NAME)
def test_what_is_said_to_be_tested_elsewhere_is(module):
    assert (SRC / module).exists(), "it is no more: take it out"
    own = TESTS / Path(module).with_name(f"test_{Path(module).name}")
    assert not own.exists(), "it has a test file of its own now: take it out"
    assert lines_of_code(Path(module)) > WORTH_A_TEST, "it is so small that it need not be here: take it out"
    assert (TESTS / UNTESTED_BY_NAME[module]).is_file(), "the test file that is named is not there"


def test_every_pinned_package_installs_on_the_oldest_python_that_midair_takes():
    """Debian 12 has Python 3.11.2; a pin that asked for 3.11.5 let `make test` fail there."""
    oldest = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["requires-python"]
    lowest = oldest.removeprefix(">=") + ".0"
    pinned = {line.partition("==")[0] for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()}
    asks = {each.name: each.metadata.get("Requires-Python") for each in distributions() if each.name in pinned}
    assert len(asks) > 100
    assert {name: asked for name, asked in asks.items() if asked and lowest not in SpecifierSet(asked)} == {}


def test_the_extra_all_is_every_extra_that_installs_anywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    (everything,) = extras["all"]
    named = re.fullmatch(r"midair\[(.*)\]", everything).group(1).split(",")
    assert named == sorted(set(named))
    assert set(named) - set(extras) == set(), "no such extras"
    assert set(named) | set(LEFT_OUT_OF_ALL) == set(extras), "every extra is in `all`, or there is a reason"
    assert set(named).isdisjoint(LEFT_OUT_OF_ALL)
