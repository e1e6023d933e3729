"""Text of strangers where it must do nothing: on a terminal, and in a cell of a spreadsheet."""

import re


def printable(text: str) -> str:
    """The same with what steers a terminal, or hides from the eye, spelled out, ESC as its number; line ends stay.

    File names, notes, names of channels and of devices come from anywhere: an escape sequence in one could wipe the
    screen, write to the clipboard, or turn a warning around.
    """
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() or letter in "\n\t" else letter.encode("unicode_escape").decode()
        for letter in text
    )


def no_formula(value: object) -> object:
    """A value for a cell of CSV: text that a spreadsheet would take for a formula gets an apostrophe in front.

    Numbers stay as they are, a minus and all, also where they are spelled as text.
    """
    if not isinstance(value, str) or not value.startswith(_FORMULA) or _is_number(value):
        return value
    return f"'{value}"


def without_formulas(json_text: str) -> str:
    """JSON in which no comma, semicolon or tab is followed by what begins a formula.

    Where a line of JSON heads a CSV, spreadsheets cut it at those. In JSON they stand next to each other inside text
    only, where an escape means the same.
    """
    return _BEFORE_FORMULA.sub(lambda found: f"{found[1]}\\u{ord(found[2]):04x}", json_text)


_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_BEFORE_FORMULA = re.compile(r"([,;\t])([=+\-@])")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
