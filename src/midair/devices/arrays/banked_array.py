"""An array, real or emulated, that plays from two pattern banks."""

from collections.abc import Callable
from dataclasses import replace

from midair.devices.arrays.banks import Banks, UnitsArray
from midair.devices.arrays.silencer import SilencerChoice, choose_silencer
from midair.devices.arrays.streaming import DriveStream, play_stream
from midair.devices.frame_bytes import divider, intensity_bytes, phase_bytes
from midair.devices.interface import PlayReport
from midair.errors import DeviceError, TooHotError
from midair.model import Drive, Placement, Progress


class BankedArray(UnitsArray[Banks]):
    """Streams drives through two banks, and is silent at all other times.

    `connect` opens the device and returns its banks; `silencer` as in `choose_silencer`; `block` is the maximum length
    of a block, in s; the other parameters are as in `ArrayDevice`.
    """

    streams = True

    def __init__(
        self,
        connect: Callable[[Placement], Banks],
        placement: Placement,
        *,
        name: str,
        silencer: SilencerChoice = "auto",
        block: float = 0.25,
        simulated: bool = False,
        exclusive: str | None = None,
    ) -> None:
        super().__init__(connect, placement, name=name, simulated=simulated, exclusive=exclusive)
        self.silencer: SilencerChoice = silencer
        self.block = block
        self._silenced = 0

    @property
    def emitting(self) -> bool:
        """True if the device reports that it plays."""
        return self._units is not None and self._units.emitting()

    def emit(self, drive: Drive, progress: Progress | None, *, repeats: int = 1, delay: float = 0.0) -> PlayReport:
        """Stream every frame through the two banks, and return the result."""
        # Read first, so that a silence during the preparation ends this playback.
        ordered = self._silenced
        banks, ticks = self.units, divider(drive.rate)
        phases = phase_bytes(drive, self.placement.units)
        intensity = intensity_bytes(drive, self.placement.units)
        silencer = choose_silencer(self.silencer, drive)
        paused: list[float] = []

        def check() -> None:
            with self.sounding(), self._lock:
                if self._silenced != ordered:
                    raise DeviceError(f"{self.name}: silenced by another thread during playback")

        def switch(bank: int, instant: int) -> None:
            # The lock prevents a silence from another thread between this check and the switch.
            with self.sounding(), self._lock:
                check()
                banks.switch(bank, instant)

        def cool(hot: TooHotError) -> None:
            paused.append(self.wait_while_hot(hot, check))

        # The silencer is set while nothing sounds, and `play_stream` begins on silent banks.
        banks.silence()
        try:
            self._make_ready(banks)
        except TooHotError as hot:
            cool(hot)
        banks.set_silencer(silencer)

        stream = DriveStream(
            phases=phases, intensity=intensity, divider=ticks, repeats=repeats, delay=delay, block=self.block
        )
        report = play_stream(stream, banks, progress=progress, switch=switch, cool=cool)
        return replace(report, silencer=str(silencer), paused=sum(paused))

    def _make_ready(self, banks: Banks) -> None:
        """Refuse units that are too hot, and release an active failsafe; the units are silent."""
        state = banks.state()
        if state is None:
            return
        state.check_heat()
        if state.silenced:
            banks.release()

    def silence(self) -> None:
        """Stop all sound immediately, from any thread; active playback ends with an error."""
        with self._lock:
            if self._units is not None:
                self._silenced += 1
                self._units.silence()

    def describe(self) -> dict[str, str]:
        """Information from the units, and properties of all arrays of this kind."""
        return {
            **self.units.describe(),
            "rate": "any that is 40 kHz / N: 1000 Hz is N = 40; silencer chosen from steps",
            "power": "cannot be asked; a unit takes up to 50 W at full drive",
        }
