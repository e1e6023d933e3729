"""A motion stage that moves the object: options of `record`, its plan in words, its strokes."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from midair import devices, files, rig
from midair.cli.console import err
from midair.cli.options import quantity
from midair.errors import InputError
from midair.model import Setting, StageSetup

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
        setup = files.load_stage(self.stage_file)
        setup.check(self.stroke)
        return Drawing(stage=rig.stage_named(self.stage), setup=setup, stroke=self.stroke, speed=speed, home=self.home)


@dataclass(frozen=True, kw_only=True)
class Drawing(AbstractContextManager[devices.GrblStage]):
    """Strokes of a motion stage, which is open inside the block; lengths in m, speed in m/s."""

    stage: devices.GrblStage
    setup: StageSetup
    stroke: float
    speed: float
    home: bool

    def __enter__(self) -> "devices.GrblStage":
        return self.stage.__enter__()

    def __exit__(self, *error: object) -> None:
        self.stage.__exit__(*error)

    @property
    def seconds(self) -> float:
        """Estimated time of a stroke with the way down and up, plus a second for acceleration."""
        down = self.setup.clear - self.setup.contact
        return down / self.setup.approach + self.stroke / self.speed + down / self.setup.back + 1.0

    @property
    def settings(self) -> dict[str, Setting]:
        """The request, for the provenance."""
        return {
            "stage": self.stage.name,
            "firmware": self.stage.firmware,
            "stroke_m": self.stroke,
            "speed_m_s": self.speed,
            "heading": self.setup.heading,
            "start_m": self.setup.start,
            "contact_m": self.setup.contact,
            "clear_m": self.setup.clear,
            "approach_m_s": self.setup.approach,
            "return_m_s": self.setup.back,
        }

    @property
    def stands(self) -> str:
        """Position of the stage in words."""
        return f"the stage stands at {self.stage.stands}"

    def prepare(self, repeats: int, stopped: Stopped) -> None:
        """Find the position and print the plan; only --home moves the stage."""
        stage, setup = self.stage, self.setup
        if self.home:
            err().print(f"{stage.name}: homing now; the stage moves")
            stage.home(stopped)
        stage.ready(homing=setup.homing == "switches")
        stage.check_speed(self.speed, self.stroke, "xyz".index(setup.heading[1]))
        origin = "its switches" if setup.homing == "switches" else "where it was set by hand"
        (x, y), contact, clear = (1e3 * part for part in setup.start), 1e3 * setup.contact, 1e3 * setup.clear
        err().print(f"stage {stage.name}, {stage.firmware}, at {stage.stands} by {origin}")
        err().print(
            f"it will move: over x {x:g}, y {y:g} mm at z {clear:g} mm; then {repeats} x down to z {contact:g} mm at "
            f"{1e3 * setup.approach:g} mm/s, {1e3 * self.stroke:g} mm along {setup.heading} at {1e3 * self.speed:g} "
            f"mm/s, up and back at {1e3 * setup.back:g} mm/s; Ctrl-C holds it"
        )

    def to_start(self, stopped: Stopped) -> None:
        """Move to the start of a stroke; KeyboardInterrupt if stopped on the way."""
        here = self.stage.ready(homing=self.setup.homing == "switches").position
        if not rig.move_to_start(self.stage, self.setup, here, stopped):
            err().print(self.stands)
            raise KeyboardInterrupt

    def one_stroke(self, stopped: Stopped) -> "rig.StageStroke":
        """The stroke that runs during a take."""
        return rig.StageStroke(self.stage, self.setup, stroke=self.stroke, speed=self.speed, stopped=stopped)
