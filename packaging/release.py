"""Make and check a release: `make release` for the version as it is, `make release VERSION=0.2.0` for a new one.

Works on a clone in a temporary folder. With a new version it commits the changed version, citation and changelog there,
and takes this commit over with its tag only after every step has passed. Nothing is uploaded. The results are in dist/:
sdist, wheel, software bill of materials, SHA256SUMS.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import venv
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).parents[1]
VERSION = re.compile(r"\d+\.\d+\.\d+((a|b|rc)\d+)?")
PLACEHOLDER = "example.org"


def main() -> None:
    """Run all steps; the first one that fails ends the release."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--version", default="", help="New version, such as 0.2.0; without it the version stays.")
    parser.add_argument("--tools", type=Path, required=True, help="Folder of the programs build, twine, ....")
    parser.add_argument("--skip-demo", action="store_true", help="Do not run midair demo from the wheel.")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder) / "midair"
        run("git", "clone", "--quiet", "--no-hardlinks", ROOT, clone)
        if given.version:
            if run("git", "status", "--porcelain", cwd=ROOT):
                sys.exit("release: expected no uncommitted changes, got some; commit them first")
            bump(clone, given.version, datetime.now(UTC).date().isoformat())
            run("git", "commit", "--quiet", "--all", "--message", f"release: {given.version}", cwd=clone)
        version = check_versions(clone)
        print(f"version {version}, commit {run('git', 'rev-parse', '--short', 'HEAD', cwd=clone)}")
        run(given.tools / "cffconvert", "--validate", "--infile", clone / "CITATION.cff")
        print("CITATION.cff: valid")
        made = build_twice(clone, given.tools, Path(folder))
        run(given.tools / "twine", "check", "--strict", *made)
        print("twine check: passed")
        environment = install(clone, made, Path(folder), demo=not given.skip_demo)
        dist = ROOT / "dist"
        shutil.rmtree(dist, ignore_errors=True)
        dist.mkdir()
        for file in made:
            shutil.copy2(file, dist)
        sbom = dist / f"midair-{version}.cdx.json"
        run(given.tools / "cyclonedx-py", "environment", environment, "--output-reproducible", "--output-file", sbom)
        sums = [f"{digest(file)}  {file.name}\n" for file in sorted(dist.iterdir())]
        (dist / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")
        print("".join(sums), end="")
        if given.version:
            run("git", "pull", "--quiet", "--ff-only", clone, "HEAD", cwd=ROOT)
            run("git", "tag", "--annotate", f"v{version}", "--message", f"midair {version}", cwd=ROOT)
            print(f"committed and tagged v{version}; next: git push --follow-tags, and upload dist/")
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
    if any(PLACEHOLDER in url for url in urls.values()):
        print("not ready to upload: [project.urls] in pyproject.toml still has placeholders")


def bump(root: Path, version: str, date: str) -> None:
    """Write a version and its date into the files that state them."""
    if not VERSION.fullmatch(version):
        sys.exit(f"release: expected a version such as 0.2.0 or 0.2.0rc1, got {version}")
    for name, pattern, line in (
        ("src/midair/version.py", r'__version__ = ".*"', f'__version__ = "{version}"'),
        ("CITATION.cff", r"version: .*(\ndate-released: .*)?", f"version: {version}\ndate-released: {date}"),
        ("CHANGELOG.md", r"## Unreleased\n", f"## Unreleased\n\n## {version} ({date})\n"),
    ):
        path = root / name
        text, count = re.subn(f"(?m)^{pattern}", line, path.read_text(encoding="utf-8"), count=1)
        if not count:
            sys.exit(f"release: expected a line {pattern!r} in {name}, got none")
        path.write_text(text, encoding="utf-8")


def check_versions(root: Path) -> str:
    """The version, if every file that states one states the same."""
    here = {
        name: re.search(pattern, (root / name).read_text(encoding="utf-8"), re.MULTILINE)
        for name, pattern in (
            ("src/midair/version.py", r'__version__ = "(.+)"'),
            ("CITATION.cff", r"^version: (.+)"),
            ("CHANGELOG.md", r"^## (?!Unreleased)(\S+) \("),
        )
    }
    stated = {name: match[1] for name, match in here.items() if match}
    if len(set(stated.values())) != 1:
        sys.exit(f"release: expected one version, got {stated}")
    return stated["CITATION.cff"]


def build_twice(clone: Path, tools: Path, folder: Path) -> list[Path]:
    """Build sdist and wheel twice, in different folders, and compare their bytes."""
    # The time of the commit, so that a release can be built again from its tag.
    os.environ["SOURCE_DATE_EPOCH"] = run("git", "log", "-1", "--format=%ct", cwd=clone)
    outs = [folder / "first", folder / "second"]
    again = folder / "again" / "midair"
    shutil.copytree(clone, again)
    for out, source in zip(outs, (clone, again), strict=True):
        run(tools / "python", "-m", "build", "--no-isolation", "--outdir", out, source)
    made = sorted(outs[0].iterdir())
    for file in made:
        if digest(file) != digest(outs[1] / file.name):
            sys.exit(f"release: {file.name}: expected the same bytes from two builds, got different ones")
        print(f"{file.name}: {file.stat().st_size / 1e6:.2f} MB, bit-equal from two builds")
    return made


def install(clone: Path, made: list[Path], folder: Path, *, demo: bool) -> Path:
    """Install the wheel into a clean environment and run the demo there."""
    environment = folder / "environment"
    venv.create(environment, with_pip=True)
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    wheel = next(file for file in made if file.suffix == ".whl")
    constraints = clone / "constraints.txt"
    run(programs / "python", "-m", "pip", "install", "--quiet", "--constraint", constraints, wheel)
    size = sum(file.stat().st_size for file in environment.rglob("*") if file.is_file())
    print(f"installed: {run(programs / 'midair', '--version')}, {size / 1e6:.0f} MB with all it needs")
    if demo:
        start = time.monotonic()
        run(programs / "midair", "demo", cwd=folder)
        if not (folder / "demo" / "report.html").exists():
            sys.exit("release: expected demo/report.html from the installed wheel, got none")
        print(f"demo from the wheel: {time.monotonic() - start:.0f} s")
    return environment


def digest(file: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def run(*words: str | Path, cwd: Path | None = None) -> str:
    """Output of a program; ends the release with its messages if it fails."""
    # Neither this environment nor its settings reach the programs of another one.
    outside = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run([str(word) for word in words], cwd=cwd, env=outside, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"release: {' '.join(map(str, words))} failed:\n{done.stdout}{done.stderr}")
    return done.stdout.strip()


if __name__ == "__main__":
    main()
