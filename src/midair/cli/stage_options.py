"""A motion stage that moves the object: options of `record`, its plan in words, its strokes."""

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

from cyclopts import Parameter

from midair.cli.console import err
from midair.cli.options import quantity
from midair.devices import StageDevice
from midair.errors import InputError
from midair.files import load_stage
from midair.model import Provenance, Setting, StageSetup
from midair.rig import StageStroke, move_to_start, stage_named
from midair.table import Line

Stopped = Callable[[], bool]


@Parameter(name="*")
@dataclass(frozen=True, slots=True, kw_only=True)
class StageOptions:
    """Motion stage that moves the object over the sensor."""

    stage: str | None = None
    """Move the object with a Grbl 1.1 machine at grbl:PORT, one stroke per take at --speed. Prints its plan first."""
    stroke: Annotated[float | None, quantity("m")] = None
    """Length of a stroke."""
    stage_file: Path = Path("stage.toml")
    """TOML file of the stage: start of the strokes, contact height, approach, return, travel."""
    home: bool = False
    """Home the stage with its limit switches first. The stage moves."""

    def drawing(self, speed: float | None) -> "Drawing | None":
        """The requested strokes, checked before a device opens; None without --stage."""
        if self.stage is None:
            if self.stroke is not None or self.home:
                raise InputError("--stroke and --home: expected --stage with them, such as --stage grbl:PORT")
            return None
        if self.stroke is None or speed is None or speed <= 0:
            raise InputError("--stage: expected --stroke and --speed, such as --stroke 120mm --speed 50mm/s")
        setup = load_stage(self.stage_file)
        setup.check(self.stroke)
        return Drawing(stage_named(self.stage), setup, stroke=self.stroke, speed=speed, home=self.home)


class Drawing(AbstractContextManager["Drawing"]):
    """Strokes of a motion stage, which is open inside the block; lengths in m, speed in m/s."""

    def __init__(self, stage: StageDevice, setup: StageSetup, *, stroke: float, speed: float, home: bool) -> None:
        self._stage, self._setup, self._stroke, self._speed, self._home = stage, setup, stroke, speed, home

    def __enter__(self) -> Self:
        self._stage.open()
        return self

    def __exit__(self, *_: object) -> None:
        self._stage.close()

    @property
    def seconds(self) -> float:
        """Estimated time of a stroke with the way down and up, plus a second for acceleration."""
        down = self._setup.clear - self._setup.contact
        return down / self._setup.approach + self._stroke / self._speed + down / self._setup.back + 1.0

    @property
    def settings(self) -> dict[str, Setting]:
        """The request, for the provenance."""
        return {
            "stage": self._stage.name,
            "firmware": self._stage.describe().get("firmware", ""),
            "stroke_m": self._stroke,
            "speed_m_s": self._speed,
            "heading": self._setup.heading,
            "start_m": self._setup.start,
            "contact_m": self._setup.contact,
            "clear_m": self._setup.clear,
            "approach_m_s": self._setup.approach,
            "return_m_s": self._setup.back,
        }

    @property
    def stands(self) -> str:
        """Position of the stage in words."""
        return f"the stage stands at {self._stage.describe().get('stands', 'an unknown position')}"

    def prepare(self, repeats: int, stopped: Stopped) -> None:
        """Find the position and print the plan; only --home moves the stage."""
        if self._home:
            err().print(f"{self._stage.name}: homing now; the stage moves")
            self._stage.home(stopped)
        self._stage.ready(homing=self._setup.homing == "switches")
        self._stage.check_speed(self._speed, self._stroke, "xyz".index(self._setup.heading[1]))
        known = "its switches" if self._setup.homing == "switches" else "where it was set by hand"
        x, y, clear = (f"{1e3 * part:g}" for part in self._setup.above)
        said = self._stage.describe()
        err().print(f"stage {self._stage.name}, {said['firmware']}, at {said['stands']} by {known}")
        err().print(
            f"it will move: over x {x}, y {y} mm at z {clear} mm; then {repeats} x down to z "
            f"{1e3 * self._setup.contact:g} mm at {_mm_s(self._setup.approach)}, {1e3 * self._stroke:g} mm along "
            f"{self._setup.heading} at {_mm_s(self._speed)}, up and back at {_mm_s(self._setup.back)}; "
            "Ctrl-C holds it"
        )

    def to_start(self, stopped: Stopped) -> None:
        """Move to the start of a stroke; KeyboardInterrupt if stopped on the way."""
        here = self._stage.ready(homing=self._setup.homing == "switches").position
        if not move_to_start(self._stage, self._setup, here, stopped):
            err().print(self.stands)
            raise KeyboardInterrupt

    def companion(self, stopped: Stopped) -> StageStroke:
        """The stroke that runs during a take."""
        return StageStroke(self._stage, self._setup, stroke=self._stroke, speed=self._speed, stopped=stopped)


def describe_strokes(provenance: Provenance, rate: float) -> list[Line]:
    """First frame, frames, duration and speed (m/s, None if unknown) of each stroke of a recording."""
    steps: dict[str, Mapping[str, Setting]] = {step.stage: step.settings for step in provenance.steps}
    frames: Any = steps.get("events", {}).get("strokes", ())
    speeds: Any = steps.get("stage", {}).get("speed_m_s", ())
    lines: list[Line] = []
    strokes: list[dict[str, Any]] = []
    for (first, count), speed in zip(frames, speeds, strict=False):
        strokes.append({"first_frame": first, "frames": count, "seconds": count / rate, "speed_m_s": speed})
        said = "speed unknown" if speed is None else f"{1e3 * speed:.2f} mm/s in its middle"
        lines.append(("stroke", f"frames {first} to {first + count}, {count / rate:.3f} s, {said}"))
    return [*lines, {"strokes": strokes}]


def _mm_s(speed: float) -> str:
    return f"{1e3 * speed:g} mm/s"
