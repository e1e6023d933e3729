"""White noise in the participant's headphones during a presentation, which masks the sound of the array."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from midair.errors import DeviceError


class NoiseProcess:
    """Sound output of a session, held by the player process."""

    def __init__(self) -> None:
        self._held: Any = None

    def take(self, noise: Any, device: str) -> str:
        """Open the named output for the noise of a plan, or close it if there is none; returns a description."""
        self.close()
        if noise is None:
            return ""
        from midair.study import Headphones

        held = Headphones(noise, device=device)
        held.__enter__()
        self._held = held
        return noise.said

    def close(self) -> None:
        """Close the output."""
        held, self._held = self._held, None
        if held is not None:
            held.__exit__(None, None, None)

    @contextmanager
    def over(self, wanted: bool) -> Generator[None]:
        """Play noise within the block if `wanted`; DeviceError if the output is not open."""
        if not wanted:
            yield
            return
        if self._held is None:
            raise DeviceError("headphones: expected an open sound output, got none; leave the session and resume it")
        self._held.on()
        try:
            yield
        finally:
            self._held.off()
