"""``python -m tests.regression``: see there."""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from tests.regression import HERE, differences, record

parser = argparse.ArgumentParser(prog="python -m tests.regression", description="Record every figure of midair.")
parser.add_argument("--write", type=Path, metavar="FILE", help="JSON file for the figures, outside of the repository")
parser.add_argument("--against", type=Path, metavar="FILE", help="file of an earlier --write on the same machine")
parser.add_argument("--rows", nargs="+", metavar="NAME", help="only these rows, and none that they need")
given = parser.parse_args()
table = (HERE / "commands.txt").read_text(encoding="utf-8").splitlines()
table = [row for row in table if not given.rows or row.partition("|")[0].strip() in given.rows]
with tempfile.TemporaryDirectory() as work:
    folder = Path(work) / "folder"
    folder.mkdir()
    figures = record("\n".join(table), folder)
failed = [name for name, value in figures.items() if name.endswith("| exit status") and value != "0"]
print(f"{len(figures)} figures, {len(failed)} commands failed")
if given.write:
    given.write.write_text(json.dumps(figures, indent=0, sort_keys=True) + "\n", encoding="utf-8")
found = differences(json.loads(given.against.read_text(encoding="utf-8")), figures) if given.against else []
print(*found, f"{len(found)} figures differ", sep="\n") if given.against else None
sys.exit(bool(failed or found))
