"""How much a command says: -q for no bars and no meters, -v for where an error came from and what the work took."""

from collections.abc import Generator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

_FLAGS = {"-q": "quiet", "-v": "verbose", "--verbose": "verbose"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Talk:
    """How much is said.

    Parameters
    ----------
    quiet : bool
        Neither bars nor meters. Results, warnings and errors are said all the same.
    verbose : bool
        An error that nobody foresaw comes with its traceback; at the end time, memory and kernel.
    """

    quiet: bool = False
    verbose: bool = False


_talk: ContextVar[Talk | None] = ContextVar("talk", default=None)


def talk() -> Talk:
    """How much the command that runs is to say."""
    return _talk.get() or Talk()


@contextmanager
def talking(how: Talk) -> Generator[None]:
    """Say so much inside."""
    before = _talk.set(how)
    try:
        yield
    finally:
        _talk.reset(before)


def flags_of(tokens: Sequence[str]) -> tuple[Talk, list[str]]:
    """What a command line says of it, wherever it stands before ``--``, and the command line without."""
    ends = list(tokens).index("--") if "--" in tokens else len(tokens)
    said = {_FLAGS[token] for token in tokens[:ends] if token in _FLAGS}
    rest = [token for token in tokens[:ends] if token not in _FLAGS]
    return Talk(quiet="quiet" in said, verbose="verbose" in said), [*rest, *tokens[ends:]]
