"""The command `gallery`: touches to start from."""

from pathlib import Path

from midair.cli.console import print_json, print_rows
from midair.cli.options import Force, Json
from midair.cli.output import may_write, next_row, print_table
from midair.datasets import TOUCHES
from midair.evaluate import too_loud
from midair.table import Row
from midair.validation import one_of


def gallery_command(
    name: str | None = None,
    output: Path | None = None,
    /,
    *,
    pictures: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """List touches to start from, or write one.

    A touch is written as a recording, or as a pattern for midair draw. Public sets of recordings are listed in
    docs/touches.md.

    Parameters
    ----------
    name
        Touch. [default: list them]
    output
        File to write. [default: NAME.h5 or NAME.toml in this folder]
    pictures
        Folder for a picture, a film and a sound of the touch, or of all touches.

    Examples
    --------
    $ midair gallery
    $ midair gallery heartbeat
    """
    if name is not None:
        one_of(name, TOUCHES, "gallery")
    if pictures is not None:
        pictures.mkdir(exist_ok=True)
        for touch in TOUCHES.values() if name is None else [TOUCHES[name]]:
            touch.view().write(pictures)
    if name is None:
        if json:
            return print_json({"touches": {name: one.facts for name, one in TOUCHES.items()}})
        lines = ((name, f"{one.says} Felt by {one.felt} of 10. {one.licence}") for name, one in TOUCHES.items())
        return print_rows(lines)
    touch = TOUCHES[name]
    target = output or Path(name + touch.ending)
    may_write(target, force, touch.ending)
    touch.write(target)
    rows = [
        touch.facts,
        ("felt", f"by about {touch.felt} of 10 people; ears: {too_loud(touch.ears)}"),
        Row("written", str(target), text=f"{target}, licence {touch.licence}"),
        next_row("solve" if touch.pattern is None else "draw", target),
    ]
    return print_table(rows, answer=touch.says, json=json)
