"""White noise in the headphones of a participant while the player presents, so that nobody hears the array."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from midair.errors import DeviceError


class NoiseProcess:
    """The sound output of a session, held by the player's process."""

    def __init__(self) -> None:
        self._held: Any = None

    def take(self, noise: Any, device: str) -> str:
        """Hold an output for noise from now on, or none; what it gives, in words.

        Parameters
        ----------
        noise : MaskingNoise or None
            Of the plan.
        device : str
            Name of the sound output.

        Raises
        ------
        DeviceError, MissingExtraError
            If there is no such output.
        """
        self.close()
        if noise is None:
            return ""
        from midair.study import Headphones

        held = Headphones(noise, device=device)
        held.__enter__()
        self._held = held
        return noise.said

    def close(self) -> None:
        """Let go of it."""
        held, self._held = self._held, None
        if held is not None:
            held.__exit__(None, None, None)

    @contextmanager
    def over(self, wanted: bool) -> Generator[None]:
        """Noise while something is presented, where it is wanted.

        Raises
        ------
        DeviceError
            If it is wanted, and the output is gone.
        """
        if not wanted:
            yield
            return
        if self._held is None:
            raise DeviceError("headphones: expected them to be open, they are not; leave the session and go on with it")
        self._held.on()
        try:
            yield
        finally:
            self._held.off()
