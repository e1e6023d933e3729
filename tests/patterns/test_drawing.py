"""Spectrum and place of drawn foci against closed forms, in the model and on the wire of four emulated units."""

import numpy as np
import pytest
from tests.simulators.exposure_override import clear_any_exposure

from midair.errors import InputError
from midair.model import Acoustics, Medium, Placement, TransducerArray
from midair.patterns import (
    AmplitudeModulation,
    Foci,
    LateralModulation,
    Pattern,
    ReceptorWeights,
    Spot,
    draw,
    drawn_settings,
    reachable_pressure,
    wanted_amplitude,
)
from midair.patterns.shapes import Circle, Line, Points
from midair.physics import focus_phase, radiation_pressure, transfer_matrix

ARRAY, AIR = TransducerArray.autd3(), Acoustics(medium=Medium.at())


def in_the_model(pattern):
    """Complex output of the transducers in every frame."""
    return draw(pattern.foci(), ARRAY, acoustics=AIR).drive.q


def on_the_wire(pattern):
    """The same, as four emulated units emit it at the end of every frame."""
    firmware = pytest.importorskip("tests.simulators.autd3_firmware")
    drive = draw(pattern.foci(), ARRAY, acoustics=AIR).drive
    device = firmware.autd3_firmware(Placement.grid(), silencer="off")
    with device:
        report = device.play(clear_any_exposure(drive, device))
        device.units.wait_until(device.units.now() + 5_000_000)
        out = device.units.put_out()
    assert (report.frames, report.late, report.gap) == (drive.frames, 0, 0)
    ticks = round(40e3 / drive.rate)
    rows = out.row(report.start) + ticks * np.arange(drive.frames) + ticks - 1
    return np.sin(np.pi * out.pulse_width[rows] / 512) * np.exp(2j * np.pi * out.phase[rows] / 256)


EMITTED = pytest.mark.parametrize(
    "emitted", [in_the_model, pytest.param(on_the_wire, marks=pytest.mark.long)], ids=["model", "wire"]
)


def pressure_at(q, places):
    """Radiation pressure at places (place, 3) in every frame."""
    return radiation_pressure(q @ transfer_matrix(np.atleast_2d(places), ARRAY, acoustics=AIR).T, AIR.medium)


def summit(q, near, step=1e-3):
    """Place (x, y) and pressure of the maximum near a place, by a paraboloid through 5 x 5 points."""
    x, y = (each.ravel() for each in np.meshgrid(*[step * np.arange(-2, 3)] * 2))
    high = pressure_at(q[None], np.column_stack([near[0] + x, near[1] + y, np.full(25, 0.2)]))[0]
    terms = np.column_stack([np.ones(25), x, y, x**2, x * y, y**2])
    c, bx, by, xx, xy, yy = np.linalg.lstsq(terms, high, rcond=None)[0]
    off = -np.linalg.solve([[2 * xx, xy], [xy, 2 * yy]], [bx, by])
    return near[:2] + off, c + (bx * off[0] + by * off[1]) / 2


@EMITTED
def test_the_spectrum_of_amplitude_modulation_is_its_closed_form(emitted):
    for frequency, depth in ((150.0, 1.0), (40.0, 0.5), (200.0, 0.8)):
        spot = Spot(pressure_pa=80.0, am=AmplitudeModulation(frequency_hz=frequency, depth=depth))
        felt = pressure_at(emitted(Pattern(spot=(spot,), duration_s=0.1)), [0, 0, 0.2])[:, 0]
        lines = np.abs(np.fft.rfft(felt)) / len(felt)
        line = round(frequency * 0.1)
        assert lines[0] == pytest.approx(80 * (1 - depth / 2), rel=0.03), frequency
        assert 2 * lines[line] == pytest.approx(80 * depth / 2, rel=0.03), frequency
        assert 2 * np.delete(lines, [0, line]).max() < 0.03 * 80, frequency


@EMITTED
def test_three_receptors_get_a_turning_mean_and_two_lines_at_their_focus(emitted):
    weights = ReceptorWeights(slow=0.5, fast=0.3, pacinian=0.2, pacinian_hz=200.0)
    orbit = LateralModulation(frequency_hz=10.0, radius_mm=3.0, step_mm=0.9)
    pattern = Pattern(spot=(Spot(pressure_pa=100.0, lm=orbit, receptors=weights),), duration_s=0.1)
    q, places = emitted(pattern), pattern.foci().position[:, 0]
    felt = np.array([pressure_at(row[None], place)[0, 0] for row, place in zip(q, places, strict=True)])
    lines = np.abs(np.fft.rfft(felt, norm="forward"))
    # slow + fast / 2 + pacinian / 2 at 0 Hz, halves of fast at 30 Hz and of the other at 200 Hz.
    assert lines[0] == pytest.approx(75, rel=0.03)
    assert 2 * lines[[3, 20]] == pytest.approx([15, 10], rel=0.03)
    assert 2 * np.delete(lines, [0, 3, 20]).max() < 0.03 * 100
    place, _ = summit(q[42], np.round(places[42, :2], 3))
    assert np.linalg.norm(place - places[42, :2]) < 0.2e-3


@EMITTED
def test_a_circle_passes_each_place_at_the_draw_rate(emitted):
    spot = Spot(shape=Circle(radius_mm=15.0), centre_mm=(5.0, -3.0), draw_hz=50.0, pressure_pa=60.0)
    q = emitted(Pattern(spot=(spot,), duration_s=0.06))
    for frame in range(0, 240, 37):
        angle = 2 * np.pi * 50 * frame / 4000
        wanted = np.array([5e-3 + 15e-3 * np.cos(angle), -3e-3 + 15e-3 * np.sin(angle)])
        place, high = summit(q[frame], wanted)
        assert np.linalg.norm(place - wanted) < 0.2e-3
        assert high == pytest.approx(60, rel=0.03)
    beside = pressure_at(q, [5e-3, 12e-3, 0.2])[:, 0]
    lines = np.abs(np.fft.rfft(beside - beside.mean()))
    assert np.argmax(lines) == 3  # three turns
    assert np.argmax(beside[:80]) == 20  # a quarter of the first


@EMITTED
def test_an_orbit_of_lateral_modulation_has_its_places_and_its_level(emitted):
    orbit = LateralModulation(frequency_hz=10.0, radius_mm=3.0, step_mm=0.9)
    spot = Spot(pressure_pa=100.0, centre_mm=(-8.0, 4.0), lm=orbit)
    q = emitted(Pattern(spot=(spot,), duration_s=0.1, rate_hz=1000.0))
    steps = 21  # 2 pi 3 mm in steps of at most 0.9 mm
    for frame in range(0, 100, 9):
        angle = 2 * np.pi * (frame * steps // 100) / steps
        wanted = np.array([-8e-3 + 3e-3 * np.cos(angle), 4e-3 + 3e-3 * np.sin(angle)])
        place, high = summit(q[frame], wanted)
        assert np.linalg.norm(place - wanted) < 0.2e-3
        assert high == pytest.approx(100, rel=0.03)


def test_one_focus_is_the_closed_form_of_the_array_at_any_rate():
    spot = Spot(centre_mm=(10.0, 20.0), above_mm=15.0, pressure_pa=200.0)
    for rate in (1000.0, 8000.0):
        drive = draw(Pattern(spot=(spot,), duration_s=0.002, rate_hz=rate).foci(), ARRAY, acoustics=AIR).drive
        assert (drive.rate, drive.frames) == (rate, round(0.002 * rate))
        place = np.array([0.01, 0.02, 0.215])
        off = np.angle(np.exp(1j * (drive.phase[0] - focus_phase(ARRAY, place, acoustics=AIR))))
        assert np.abs(off).max() < 1e-9
        assert pressure_at(drive.q, place)[0, 0] == pytest.approx(200, rel=1e-9)


def test_reach_is_what_full_drive_gives_and_asking_for_more_is_an_error():
    place = np.array([0.02, 0.0, 0.2])
    most = reachable_pressure(place[None], ARRAY, AIR)[0]
    full = np.exp(1j * focus_phase(ARRAY, place, acoustics=AIR))
    assert most == pytest.approx(pressure_at(full[None], place)[0, 0], rel=1e-9)

    def at(pressure):
        return Foci(position=place[None, None], pressure=np.array([[pressure]]), rate=1000.0)

    assert draw(at(0.999 * most), ARRAY, acoustics=AIR).drive.level[0] == pytest.approx(np.sqrt(0.999))
    with pytest.raises(InputError, match=r"expected at most 1\d\d\d Pa at \(20, 0, 200\) mm, all that this array"):
        draw(at(1.01 * most), ARRAY, acoustics=AIR)


def test_several_foci_at_once_have_their_pressures():
    spots = [
        Spot(centre_mm=(-20.0, 0.0), pressure_pa=60.0),
        Spot(centre_mm=(20.0, 5.0), pressure_pa=30.0, start_s=0.002),
        Spot(centre_mm=(0.0, 25.0), pressure_pa=45.0, stop_s=0.004),
    ]
    foci = Pattern(spot=tuple(spots), duration_s=0.006, rate_hz=1000.0).foci()
    solution = draw(foci, ARRAY, acoustics=AIR)
    felt = np.stack([pressure_at(solution.drive.q, foci.position[0, each])[:, 0] for each in range(3)], axis=1)
    sounding = foci.pressure > 0
    assert sounding.sum(axis=1).tolist() == [2, 2, 3, 3, 2, 2]
    assert felt[sounding] == pytest.approx(foci.pressure[sounding], rel=0.02)
    assert solution.error.max() < 0.01
    loud = Foci(position=foci.position[:1, :2], pressure=np.array([[900.0, 900.0]]), rate=1000.0)
    with pytest.raises(InputError, match=r"expected at most \d+.*\+ \d+.* Pa in 2 foci at once"):
        draw(loud, ARRAY, acoustics=AIR)


def test_silent_frames_keep_the_phases_and_have_no_level():
    foci = Pattern(spot=(Spot(shape=Line(), draw_hz=5.0, start_s=0.002, stop_s=0.004),), duration_s=0.006).foci()
    solution = draw(foci, ARRAY, acoustics=AIR)
    assert list(solution.status[7:17]) == ["silent"] + 8 * ["converged"] + ["silent"]
    assert not solution.drive.level[[0, 7, 16, 23]].any()
    assert (solution.drive.phase[16:] == solution.drive.phase[15]).all()


def test_the_target_is_the_field_of_the_drawn_focus():
    foci = Pattern(spot=(Spot(shape=Circle(), draw_hz=50.0),), duration_s=0.02).foci()
    settings = drawn_settings(foci, AIR)
    target = wanted_amplitude(foci, ARRAY, settings, draw(foci, ARRAY).drive.provenance)
    field = draw(foci, ARRAY, acoustics=AIR).drive.q @ transfer_matrix(target.grid, ARRAY, acoustics=AIR).T
    assert np.abs(np.abs(field) - target.amplitude[:]).max() < 1e-3 * np.abs(field).max()


def test_places_on_a_path(subtests):
    for spot, times, places in [
        (Spot(shape=Line(length_mm=20.0), draw_hz=1.0), [0, 0.25, 0.5, 0.75], [[-10, 0], [0, 0], [10, 0], [0, 0]]),
        (Spot(shape=Line(length_mm=20.0), draw_hz=1.0, positions=3), [0.1, 0.3, 0.5], [[-10, 0], [0, 0], [10, 0]]),
        (Spot(shape=Line(length_mm=50.0), speed_m_s=0.1), [0, 0.5], [[-25, 0], [25, 0]]),
        (Spot(shape=Circle(radius_mm=10.0), draw_hz=1.0, positions=4), [0.1, 0.3, 0.99], [[10, 0], [0, 10], [0, -10]]),
        (Spot(shape=Circle(radius_mm=10.0), turn_deg=90.0, centre_mm=(1.0, 2.0)), [0], [[1, 12]]),
        (
            Spot(shape=Points(places_mm=((0.0, 0.0), (5.0, 0.0))), draw_hz=2.0),
            [0.2, 0.25, 0.5],
            [[0, 0], [5, 0], [0, 0]],
        ),
    ]:
        with subtests.test(spot=spot):
            assert 1e3 * spot.places(np.array(times, float))[:, :2] == pytest.approx(np.array(places, float), abs=1e-3)
