"""The pages of the docs, and what they show under their commands, compared with what the commands print."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = ["README.md", *(str(path.relative_to(ROOT)) for path in sorted((ROOT / "docs").glob("*.md")))]


def blocks(page, language):
    """The code blocks of a page, in order."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def _plain(text):
    """Text without numbers and line ends, which depend on the machine and on the width of a terminal."""
    return " ".join(re.sub(r"-?\d[\d.,e+-]*", "#", text).split())


def not_printed(page, printed):
    """Lines of the text blocks that follow the consoles of a page and are not in what was printed, "..." aside."""
    found = re.findall(
        r"^```console\n(?:(?!```).*\n)+```\n+```text\n((?:(?!```).*\n)+)```",
        (ROOT / page).read_text(encoding="utf-8"),
        re.MULTILINE,
    )
    whole = _plain(printed)
    return [line for block in found for line in block.splitlines() if _plain(line.removesuffix("...")) not in whole]
