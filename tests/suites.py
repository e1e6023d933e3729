"""`python -m tests.suites [NAME ...]`: run the suites one after the other, each with a log, and print a table.

A suite that fails does not stop the next. The logs are in .suites, and the exit status is 1 if any suite failed.
"""

import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

ALONE = [sys.executable, "-m", "pytest", "--durations", "20"]
PYTEST = [*ALONE, "--numprocesses", "2", "--dist", "worksteal"]
SLOW = ["--timeout", "3000"]
COVERED = ["--cov", "--cov-report=term:skip-covered"]
SUITES = {
    "fast": [PYTEST],
    "long": [[*PYTEST, "-m", "long and not slow and not clock"], [*ALONE, "-m", "long and not slow and clock"]],
    "kernels": [[sys.executable, "-m", "tests.kernels"]],
    "browser": [[*PYTEST, "-m", "browser", "--timeout", "600"]],
    "slow": [[*PYTEST, "-m", "slow and not clock", *SLOW], [*ALONE, "-m", "slow and clock", *SLOW]],
    "coverage": [[*PYTEST, "-m", "not slow and not browser and not clock", *COVERED]],
}
"""Commands of each suite, in the order in which they run; tests that keep to a clock have no other beside them."""

COUNT = re.compile(r"(\d+) (passed|failed|skipped|error)")


def counts(text: str) -> Counter[str]:
    """Sum of the counts in the last lines of all runs of pytest in a log."""
    found = Counter[str]()
    for line in text.splitlines():
        if re.search(r"\d+ \w+.* in \d[\d.]*s\b", line):
            found.update({word: int(number) for number, word in COUNT.findall(line)})
    return found


def main(names: list[str]) -> int:
    if unknown := set(names) - set(SUITES):
        print(f"suites: expected some of {', '.join(SUITES)}, got {', '.join(sorted(unknown))}")
        return 2
    folder = Path(".suites")
    folder.mkdir(exist_ok=True)
    rows, worst = [f"{'suite':10}{'passed':>8}{'failed':>8}{'skipped':>9}{'seconds':>9}{'CPU s':>7}"], 0
    for name in [name for name in SUITES if name in (names or SUITES)]:
        log, before = folder / f"{name}.log", os.times()
        print(f"{name}: the log is {log}", flush=True)
        with log.open("wb") as out:
            runs = [subprocess.run(one, stdout=out, stderr=subprocess.STDOUT, check=False) for one in SUITES[name]]
        status = max(abs(one.returncode) for one in runs)
        text = log.read_text(encoding="utf-8", errors="replace")
        found = counts(text)
        broken = found["failed"] + found["error"]
        *_, user, system, seconds = (now - then for then, now in zip(before, os.times(), strict=True))
        row = f"{name:10}{found['passed']:8}{broken:8}{found['skipped']:9}{seconds:9.0f}{user + system:7.0f}"
        rows.append(row if not status or broken else f"{row}  exit status {status}")
        worst = max(worst, bool(status))
        for line in re.findall("^(?:FAILED|ERROR) .*", text, re.MULTILINE):
            print(line)
    print("\n".join(rows))
    return worst


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
