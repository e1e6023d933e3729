"""What a release states: one version, one list of dependencies, and files that services read."""

import json
import re
import runpy
import shutil
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[1]
STATING = ("src/midair/version.py", "CITATION.cff", "CHANGELOG.md")


def test_all_files_state_the_same_version_and_a_new_one_is_written_everywhere(tmp_path):
    release = SimpleNamespace(**runpy.run_path(str(ROOT / "packaging" / "release.py")))
    release.check_versions(ROOT)
    for name in STATING:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    release.bump(tmp_path, "7.8.9", "2030-01-02")
    assert release.check_versions(tmp_path) == "7.8.9"
    assert "date-released: 2030-01-02" in (tmp_path / "CITATION.cff").read_text(encoding="utf-8")
    release.bump(tmp_path, "7.9.0rc1", "2030-02-03")
    assert (tmp_path / "CITATION.cff").read_text(encoding="utf-8").count("date-released") == 1
    heads = re.findall(r"^## (.+)", (tmp_path / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert heads[:3] == ["Unreleased", "7.9.0rc1 (2030-02-03)", "7.8.9 (2030-01-02)"]
    for version in ("7.8", "v7.8.9", "7.8.9; rm"):
        with pytest.raises(SystemExit, match="expected a version such as"):
            release.bump(tmp_path, version, "2030-01-02")


def test_the_conda_recipe_has_the_dependencies_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    recipe = (ROOT / "packaging" / "conda" / "meta.yaml").read_text(encoding="utf-8")
    run = re.findall(r"- (\S+) (>=\S+)", recipe.partition("  run:")[2].partition("\ntest:")[0])
    other = {"soundfile": "pysoundfile", "matplotlib": "matplotlib-base"}
    wanted = [re.fullmatch(r"([\w-]+)(.*)", line) for line in project["dependencies"]]
    pairs = {(other.get(each[1], each[1]), each[2].split(",")[0]) for each in wanted if each}
    assert set(run) == pairs | {("python", project["requires-python"])}


def test_descriptions_for_services_are_valid():
    zenodo = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    assert zenodo["license"] == "MIT"
    assert f'title: "{zenodo["title"]}"' in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
