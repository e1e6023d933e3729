"""`python -m tests.words`: find sentences in src that the style of this repository forbids.

A docstring, help or message that begins with "Of the" or "What is" has no subject, and a program is not somebody.
"""

import re
import sys
import tokenize
from pathlib import Path

ROOT = Path(__file__).parents[1]
FRAGMENT = re.compile(r"(Of (a|an|the|what|it|its|each|those)|What (is|comes|was|a|an|the)) ")
PERSON = re.compile(r"\b(nobody|whoever|somebody)\b", re.IGNORECASE)
START = re.compile(r"""^(?:[rbf]*["']{1,3}|#:?)?\s*""", re.IGNORECASE)
TEXT = {tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}


def lines_of(path: Path) -> list[tuple[int, str]]:
    """Number and text of each line of a docstring, a message or a comment; of any line in what is not Python."""
    if path.suffix != ".py":
        return list(enumerate(path.read_text(encoding="utf-8").splitlines(), start=1))
    with tokenize.open(path) as file:
        found = [each for each in tokenize.generate_tokens(file.readline) if each.type in TEXT]
    return [(each.start[0] + row, text) for each in found for row, text in enumerate(each.string.splitlines())]


def forbidden(text: str) -> bool:
    """True for a line that begins as a fragment, or that names a person without a name."""
    return bool(FRAGMENT.match(START.sub("", text)) or PERSON.search(text))


def main(folders: list[str]) -> int:
    chosen = [ROOT / folder for folder in folders or ["src"]]
    paths = [path for folder in chosen for path in sorted(folder.rglob("*")) if path.suffix in {".py", ".js", ".html"}]
    found = [(path, row, text) for path in paths for row, text in lines_of(path) if forbidden(text)]
    for path, row, text in found:
        print(f"{path.relative_to(ROOT)}:{row}: {text.strip()}")
    print(f"{len(found)} lines to write again" if found else f"{len(paths)} files: every sentence is a sentence")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
