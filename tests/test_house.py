import re
import tomllib
from collections import Counter
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[1]
SRC, TESTS = ROOT / "src" / "midair", ROOT / "tests"

LEFT_OUT_OF_ALL = {
    "pyautd3": "the SDK of older firmware, whose version hangs on that of Python",
    "gpu-torch": "a GPU",
    "gpu-cupy": "a GPU of one vendor",
    "all": "itself",
    **dict.fromkeys(["test", "check", "docs", "dev"], "for those who work on midair"),
}
"""Extras that `midair[all]` does not bring, and why."""


LINES = {
    "model": 1917,
    "settings streaming .": 2828,
    "physics": 3413,
    "recordings targets correct evaluate": 4050,
    "calibration": 2940,
    "solvers": 4446,
    "files": 4468,
    "devices": 7859,
    "rig": 8720,
    "patterns datasets": 1776,
    "view figures": 2002,
    "cli": 6473,
    "study": 5902,
    "studio": 5982,
    "sweep": 502,
    "paper": 425,
}
"""Most lines of packages of src, and of the modules beside them ("."): a change lowers them or stays below them."""


def test_no_package_grows_beyond_its_lines():
    found = Counter[str]()
    for path in SRC.rglob("*.py"):
        package = path.relative_to(SRC).parts[0]
        found["." if package.endswith(".py") else package] += len(path.read_text(encoding="utf-8").splitlines())
    sums = {packages: sum(found.pop(each) for each in packages.split()) for packages in LINES}
    assert {name: lines for name, lines in sums.items() if lines > LINES[name]} == {}
    assert not found, "each package has its lines"


BESIDE = {"tests": 44_653, "benchmarks": 4_500}
"""Most lines of .py in these folders, as for the packages."""


def test_tests_and_benchmarks_stay_below_their_lines():
    found = {
        folder: sum(len(path.read_text(encoding="utf-8").splitlines()) for path in (ROOT / folder).rglob("*.py"))
        for folder in BESIDE
    }
    assert {folder: lines for folder, lines in found.items() if lines > BESIDE[folder]} == {}


SCRIPTS = 9_640
"""Most lines of JavaScript, formatted as Prettier does with 100 columns."""


def test_scripts_of_pages_stay_below_their_lines_and_have_short_ones():
    lines = [line for path in SRC.rglob("*.js") for line in path.read_text(encoding="utf-8").splitlines()]
    assert len(lines) <= SCRIPTS
    # Text that people read is not cut.
    assert [line for line in lines if len(line) > 100 and not set(line) & set("\"`'")] == []


PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "decisions").glob("*.md")),
]


def test_files_that_a_page_names_are_there():
    named = re.compile(r"(?<![\w./])((?:[a-z_0-9]+/)+[a-zA-Z_0-9-]*(?:\.py|\.toml|/)|[a-z_0-9]+\.py)(?=[`\s,;:)])")
    missing = [
        (page.relative_to(ROOT).as_posix(), name)
        for page in PAGES
        for name in sorted(set(named.findall(page.read_text(encoding="utf-8"))))
        if not any((root / name).exists() for root in (ROOT, SRC, SRC.parent, page.parent))
    ]
    assert missing == []


@pytest.mark.long
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


def test_the_studio_is_in_the_plain_install():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    plain = {re.split(r"[>=<]", each)[0] for each in project["dependencies"]}
    assert {"starlette", "uvicorn", "websockets"} <= plain
