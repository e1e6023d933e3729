"""The pages of the docs, and what they show under their commands, compared with what the commands print."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = ["README.md", *(str(path.relative_to(ROOT)) for path in sorted((ROOT / "docs").glob("*.md")))]


def fenced(page):
    """(language, code) of each block of a page, in order; a block that names no language is "plain"."""
    found = re.findall(r"^```([^\n]*)\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return [(language.strip() or "plain", code) for language, code in found]


def blocks(page, language):
    """The code blocks of a page in a language, in order."""
    return [code for name, code in fenced(page) if name == language]


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
