"""The command `gallery`: touches to start from, and public sets of recordings."""

import sys
from dataclasses import asdict
from pathlib import Path

from midair.cli.console import err, out, print_json, print_rows
from midair.cli.options import Force, Json
from midair.cli.output import may_write
from midair.datasets import PUBLIC_SETS, TOUCHES, PublicSet
from midair.errors import InputError


def gallery_command(
    name: str | None = None,
    output: Path | None = None,
    /,
    *,
    pictures: Path | None = None,
    yes: bool = False,
    force: Force = False,
    json: Json = False,
) -> None:
    """List touches to start from, and public sets of recordings; write or fetch one.

    A touch is written as a recording, or as a pattern for midair draw. midair contains no public set: one is fetched
    only if its licence was read, after a question; of the others, the command prints where they are.

    Parameters
    ----------
    name
        Touch or set. [default: list them]
    output
        File to write. [default: NAME.h5, NAME.toml or NAME.zip in this folder]
    pictures
        Folder for a picture, a film and a sound of the touch, or of all touches.
    yes
        Fetch a set without a question.

    Examples
    --------
    $ midair gallery
    $ midair gallery heartbeat
    $ midair gallery cluster
    """
    known = (*TOUCHES, *PUBLIC_SETS)
    if name is not None and name not in known:
        raise InputError(f"gallery: expected one of {', '.join(known)}, got {name!r}")
    if pictures is not None:
        pictures.mkdir(exist_ok=True)
        for touch in TOUCHES.values() if name is None else [TOUCHES[name]] if name in TOUCHES else ():
            touch.view().write(pictures)
    if name is None:
        _list(json=json)
    elif name in PUBLIC_SETS:
        _show_set(PUBLIC_SETS[name], output or Path(f"{name}.zip"), yes=yes, force=force, json=json)
    else:
        touch = TOUCHES[name]
        target = output or Path(name + touch.ending)
        may_write(target, force, touch.ending)
        touch.write(target)
        verb = "solve" if touch.pattern is None else "draw"
        rows = {"written": str(target), "what": touch.says, "licence": touch.licence, "next": f"midair {verb} {target}"}
        print_json(rows) if json else print_rows(rows.items())


def _list(*, json: bool) -> None:
    if json:
        touches = {name: {"says": one.says, "licence": one.licence} for name, one in TOUCHES.items()}
        print_json({"touches": touches, "sets": {name: asdict(one) for name, one in PUBLIC_SETS.items()}})
        return
    out().print("Touches, with midair:")
    print_rows((name, f"{one.says} {one.licence}") for name, one in TOUCHES.items())
    out().print("\nPublic sets, not with midair:")
    print_rows((name, f"{one.title}; {one.size}; licence: {one.licence}") for name, one in PUBLIC_SETS.items())


def _show_set(one: PublicSet, target: Path, *, yes: bool, force: bool, json: bool) -> None:
    """Print the facts of a set, and fetch it if that is permitted and wanted."""
    rows = {"set": one.title, "holds": one.holds, "licence": one.licence, "size": one.size, "where": one.place}
    rows["reader"] = one.reader
    if one.archive:
        may_write(target, force, ".zip")
        wanted = yes
        if not yes:
            # The question is for a person, who has read the licence and the size.
            print_rows(rows.items())
            err().print(f"Fetch {one.size} from {one.archive}? [y/N] ", end="")
            wanted = sys.stdin.readline().strip().lower() in ("y", "yes")
        if wanted:
            one.fetch(target)
        rows = {"set": one.title, "written": str(target) if wanted else "not fetched"} | (rows if yes else {})
    print_json(rows) if json else print_rows(rows.items())
