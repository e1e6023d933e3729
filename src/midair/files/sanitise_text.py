"""Make untrusted text safe for a terminal and for a spreadsheet cell."""

import re


def printable(text: str) -> str:
    """Escape control and invisible characters except line ends and tabs; untrusted text could control a terminal."""
    if text.isprintable():
        return text
    return "".join(
        letter if letter.isprintable() or letter in "\n\t" else letter.encode("unicode_escape").decode()
        for letter in text
    )


def no_formula(value: object) -> object:
    """Put an apostrophe before text that a spreadsheet would run as a formula; numbers are unchanged, also as text."""
    if not isinstance(value, str) or not value.startswith(_FORMULA) or _is_number(value):
        return value
    return f"'{value}"


def without_formulas(json_text: str) -> str:
    """JSON in which no comma, semicolon or tab, where a spreadsheet may split a line, is followed by a formula."""
    return _BEFORE_FORMULA.sub(lambda found: f"{found[1]}\\u{ord(found[2]):04x}", json_text)


_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_BEFORE_FORMULA = re.compile(r"([,;\t])([=+\-@])")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
