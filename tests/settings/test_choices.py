from midair.model import Acoustics, Medium
from midair.settings import CHOICES, MODES, Settings, format_setting, nearest_mode
from midair.solvers import Fast, QuietEars


def test_each_option_sets_what_it_reads():
    given = {"rate": 2000.0, "mapping": "slow-bias", "ears": 110.0, "height": 0.3, "circle": 3e-3, "method": "fast"}
    more = {"band": (30.0, 300.0), "gain": 2.0, "strength": 0.1, "jobs": 3, "directivity": "piston"}
    given |= more | {"temperature": 25.0, "humidity": 0.2}
    made = Settings().but(quiet_ears=QuietEars(weight=1.0)).but(**given, quiet_ears=2.0)
    read = {choice.name.replace("-", "_"): choice.of(made) for choice in CHOICES}
    assert read == given | {"quiet_ears": 2.0}
    assert isinstance(made.solver.quiet_ears, QuietEars), "the rest of the term stays"
    assert made.but(circle=0, quiet_ears=0).target.circle is None


def test_a_temperature_is_the_air_of_a_laboratory_and_the_surface_stays():
    soft = Settings(acoustics=Acoustics(medium=Medium(alpha=1.5), directivity="piston"))
    warm = soft.but(temperature=26.0).but(humidity=0.3)
    assert warm.acoustics == Acoustics(
        medium=Medium.at(temperature=26.0, humidity=0.3, alpha=1.5), directivity="piston"
    )
    assert soft.but(temperature=26.0).acoustics.medium.humidity == 0.5


def test_any_setting_is_a_line_of_a_file():
    lines = "solver.level=auto target.grid={rows=6,columns=6} solver.iterations=[2,1] solver.guard.margin=0.03"
    made = MODES["best"]().with_lines(lines.split())
    assert (made.target.grid.rows, made.solver.level, made.solver.iterations) == (6, "auto", (2, 1))
    assert made.solver.guard.ceiling == MODES["best"]().solver.guard.ceiling
    assert MODES["best"]().with_lines(["acoustics.medium.temperature=30"]) == MODES["best"]().but(temperature=30.0)
    assert MODES["best"]().but(guard=0.03).solver.guard == made.solver.guard
    assert MODES["best"]().with_lines(["solver.guard=0.0"]) == MODES["best"]().but(guard=0.0)


def test_a_setting_is_formatted_with_its_unit():
    for path, value, words in (
        ("target.grid.height", 0.2, "200mm"),
        ("calibration.band", (20.0, 470.0), "20Hz 470Hz"),
        ("acoustics.medium.speed", 345.0, "345m/s"),
        ("compensation.dynamics.time_constant", 1.9e-4, "0.00019s"),
        ("solver.method.near", 0.2, "0.2"),
        ("target.strength", None, "default"),
    ):
        assert format_setting(path, value) == words, path


def test_settings_are_their_mode_and_what_differs_from_it(subtests):
    for mode, made in MODES.items():
        with subtests.test(mode=mode):
            assert nearest_mode(made()) == (mode, {})
            nearest, others = nearest_mode(made().but(gain=2.0, level=0.5, temperature=30.0))
            assert nearest == mode
            assert others.keys() >= {"target.gain", "solver.level", "acoustics.medium.temperature"}
            assert "acoustics.medium.speed" not in others, "it follows from the temperature"
            assert nearest_mode(made().but(ramp=1e-3)) == (mode, {"compensation.ramp": 1e-3})
            assert nearest_mode(made().but(method=Fast(iterations=9))) is None, "no option sets it"
