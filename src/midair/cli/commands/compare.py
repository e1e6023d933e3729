"""The command `compare`: a re-recording against its original."""

from contextlib import ExitStack
from pathlib import Path

from midair.cli.terminal import (
    BandOptions,
    Json,
    banner,
    brought_together,
    card_of,
    felt_part,
    kept_aside,
    made_with,
    plain,
    print_card,
    print_figures,
    print_json,
)
from midair.evaluate import compare
from midair.files import open_take


def compare_command(
    original: Path,
    reproduced: Path,
    /,
    *,
    options: BandOptions | None = None,
    json: Json = False,
) -> None:
    """Compare a re-recording with its original: waveform, spectrum, level, place, delay, and what skin makes of it.

    Band, rate, lead and the part of the original that was played are those that the re-recording says it was made with.
    What was played passes the soft edges of the band twice, so the original is compared through them once more.

    Parameters
    ----------
    original
        A recording with a calibration.
    reproduced
        What was re-recorded of its reproduction.
    options
        Of the band, where the re-recording does not say.

    Examples
    --------
    $ midair compare take.h5 take.rerecorded.h5
    """
    again = open_take(reproduced, streamed=True).recording
    settings = made_with(again.provenance, (options or BandOptions()).settings())
    with ExitStack() as stack:
        both = brought_together(felt_part(original, settings, streamed=True), reproduced, settings)
        before, after = (stack.enter_context(kept_aside(each)) for each in both)
        comparison, card = compare(before, after), card_of(before, after)
    if json:
        return print_json(plain(comparison) | {"perception": None if card is None else card.plain()["figures"]})
    banner(comparison.simulated)
    print_figures(f"{reproduced.name} against {original.name}", {"": comparison.figures()})
    if card is not None:
        print_card(card)
    return None
