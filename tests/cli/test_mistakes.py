"""What people type wrong, all in one table: one line that says so, the status, nothing left, nothing changed."""

import shlex
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
import soundfile

from midair.cli import run
from midair.files import save
from midair.model import Recording, SensorGrid

MISTAKES = (
    ("slove take.h5", 2, 'Unknown command "slove". Did you'),
    ("--verison", 2, 'Unknown command "--verison".'),
    ("record", 2, 'Command "record" parameter SENSOR'),
    ("record virtual:towel x.h5 --duration 1", 2, "expected a quantity such as 0.5s,"),
    ("record virtual:towel x.h5 --duration -1s", 2, "--duration: expected a value, got -1s; none below 0"),
    ("record virtual: x.h5", 2, "expected virtual:OBJECT,"),
    ("record towel x.h5", 2, "expected virtual:OBJECT,"),
    ("record usb:1 x.h5", 2, "usb:1"),
    ("record virtual:cat x.h5", 2, "cat"),
    ("record virtual:towel x.h5 --duration 0s", 1, "duration"),
    ("record replay:take.h5 x.h5 --trigger 3Pa", 1, "gives V"),
    ("record replay:take.h5 x.h5 --trigger 0.5", 1, "add the unit"),
    ("record replay:take.h5 x.h5 --trigger 0V", 1, "above 0"),
    ("record replay:take.h5 x.h5 --trigger 100V", 1, "nothing was recorded"),
    ("record replay:take.h5 x.h5 --pre-roll 90s --trigger 1V", 1, "0 to 60 s"),
    ("record virtual:towel x.wav", 1, "expected NAME.h5, or an existing folder"),
    ("record virtual:towel nowhere/x.h5", 1, "expected the folder"),
    ("record virtual:towel there.h5", 1, "there.h5: is there already; give"),
    ("record virtual:towel x.h5 --repeats 0", 1, "expected 1 or more, got 0"),
    ("record virtual:towel x.h5 --sensor-file nothing.toml", 1, "expected a TOML file that"),
    ("record virtual:towel x.h5 --sensor-file broken.toml", 1, "expected a TOML file that"),
    ("record replay:nothing.h5 x.h5", 1, "expected a file, found none; check"),
    ("record lsl: x.h5", 2, "expected virtual:OBJECT,"),
    ("record serial:/dev/nothing x.h5", 1, "expected a port /dev/nothing, got:"),
    ("record virtual:towel x.h5 --trigger 3mm", 1, "expected a quantity such as 1V,"),
    (
        "record virtual:towel x.h5 --stage grbl:/dev/nothing --stroke 120mm --speed 50mm/s",
        1,
        "expected a TOML file that describes",
    ),
    ("info", 2, 'Command "info" parameter SOURCE'),
    ("info nothing.h5", 1, "expected a file, found none; check"),
    ("info .", 1, "expected a name that ends in .h5,"),
    ("info text.csv", 1, "expected a number, got 'no"),
    ("info truncated.h5", 1, "truncated.h5"),
    ("info empty.h5", 1, "empty.h5"),
    ("info nothing.txt", 1, "expected a name that ends in .h5,"),
    ("info take.h5 take.h5", 2, "unexpected: take.h5; options begin"),
    ("info take.h5 --jsn", 2, "Unknown option: --jsn. Did you"),
    ("import", 2, 'Command "import" parameter SOURCE'),
    ("import nothing.wav", 1, "expected a file, found none; check"),
    ("import song.wav", 1, "give --unit V, count or Pa, or"),
    ("import song.wav --unit Volt", 2, 'Invalid value "Volt" for --unit.'),
    ("import song.wav --scale 30", 2, "expected a quantity such as 30Pa,"),
    ("import song.wav --scale 30mm", 2, "expected a quantity such as 30Pa,"),
    ("import song.wav --unit V --footprint circle", 2, "expected SHAPE:SIZE such as"),
    ("import song.wav --unit V --footprint circle:20", 2, "expected a quantity such as 200mm,"),
    ("import song.wav --unit V --footprint star:20mm", 2, "expected SHAPE:SIZE such as"),
    ("import song.wav --unit V --footprint circle:20mm --speed 50", 2, "expected a quantity such as"),
    ("import song.wav --unit V --layout 4x4", 2, "expected ROWSxCOLUMNS:PITCH such"),
    ("import song.wav --unit V --layout 4x4:11mm", 1, "song.wav: the file has 1 channels,"),
    ("import song.wav --unit V --channels 7", 1, "expected a channel by name (no"),
    ("import song.wav x.txt --unit V", 1, "expected a name that ends in .h5,"),
    ("import song.wav x.drive.h5 --unit V", 1, "expected a recording; names that"),
    ("import song.wav --unit V --rate 44100Hz", 1, "got 44100 Hz; leave the rate out"),
    ("import song.wav --scale 2Pa --resample 10Hz", 1, "expected 40 Hz or more, twice the lowest frequency in use"),
    ("import song.wav --unit V --path z", 2, 'Invalid value "z" for --path.'),
    ("import five.csv", 1, "five.csv: the file does not state"),
    ("import five.csv --unit V", 1, "five.csv: the file does not state"),
    (
        "import five.csv --unit V --rate 1kHz",
        1,
        "give --layout ROWSxCOLUMNS:PITCH such as 4x4:11mm, or --channels 0 to choose one",
    ),
    ("import gaps.csv --unit V", 1, "expected finite numbers, got nan"),
    ("import take.h5 x.h5 --peak 1Pa --sensitivity 1V/Pa", 1, "one"),
    ("import take.h5 x.h5 --sensitivity 1mm", 1, "sensitivity"),
    ("import x.hjif --scale 2Pa", 1, "x.hjif: expected MPEG haptics with"),
    ("import x.m4a", 1, "expected a name that ends in .h5,"),
    ("import song.wav --reference nothing.wav", 1, "nothing.wav: expected a file, found none;"),
    ("import song.wav --reference song.wav --tone loud", 1, "--tone: expected a level re"),
    ("import song.wav --reference song.wav --drop 2g", 1, "--drop: expected MASS:HEIGHT:DIAMETER such"),
    ("import song.wav --reference song.wav --drop 2g:5cm:1cm", 1, "reference: expected one impact"),
    ("import song.wav --reference song.wav --scale 2Pa", 1, "--reference: expected it without --scale"),
    ("import sample:fur", 1, "expected one of denim, connect,"),
    ("import sample:towel --rate 1kHz", 1, "sample:towel: expected no file options"),
    ("import sample:", 1, "expected one of denim, connect,"),
    ("import take.h5 --peak 30", 2, "expected a quantity such as 30Pa,"),
    ("import take.h5 --peak -30Pa", 2, "--peak: expected a value, got -30Pa; none below 0"),
    ("import take.h5 --sensitivity 20", 1, "take.h5: already exists; give"),
    ("import take.h5 --sensitivity 20mV", 1, "take.h5: already exists; give"),
    ("import song.wav --scale 2Pa --footprint circle:2m", 1, "size of the footprint: expected 1e-06 to 1 m, got 2"),
    ("mend gaps.csv --unit V --longest 20", 2, "expected a quantity such as 0.5s,"),
    ("mend gaps.csv --unit V --fill magic", 2, 'Invalid value "magic" for --fill.'),
    ("export take.h5", 2, 'Command "export" parameter OUTPUT'),
    ("export take.h5 take.h5", 1, "take.h5: already exists; give"),
    ("export take.h5 take", 1, ".npz, .mat, .nc, .hjif, .ahap, .haptic; got 'no ending'"),
    ("export take.h5 take.mp3", 1, "MP3 can be read, not written; writable formats are .h5, .hdf5, .csv"),
    ("export there.drive.h5 x.wav", 1, "expected a name that ends in .npz or .json"),
    ("show there.drive.h5 x.gif", 1, "a file to write is --save x.gif"),
    ("cut take.h5 x.h5 --end 0.1s --duration 0.1s", 1, "expected --end or --duration, got both"),
    ("solve take.h5 x.drive.h5 --mode paper --ears 110dB", 1, "ears: expected a faster method, got exact"),
    ("play there.drive.h5 --follow hand.csv", 2, "tracker: expected leap:PLACE, lsl:PLACE, osc:PLACE, replay:PLACE"),
    ("live --sensor virtual:towel --follow palm", 2, "tracker: expected leap:PLACE, lsl:PLACE"),
    ("export take.h5 take.xlsx", 1, "expected a name that ends in .h5,"),
    ("export take.h5 nowhere/take.csv", 1, "expected the folder"),
    ("export raw.h5 x.csv --pressure", 1, "expected calibrated pressure in"),
    ("cut take.h5", 2, 'Command "cut" parameter OUTPUT'),
    ("cut take.h5 x.h5 --start 5s", 1, "expected a part of 0 to 0.3 s, got"),
    ("cut take.h5 x.h5 --start 0.2s --end 0.1s", 1, "expected a part of 0 to 0.3 s, got"),
    ("cut take.h5 x.h5 --start 100", 2, "expected a quantity such as 0.5s,"),
    ("cut take.h5 take.h5", 1, "take.h5: already exists; give"),
    ("join take.h5", 1, "expected two or more recordings"),
    ("join take.h5 small.h5 x.h5", 1, "expected sensor <SensorGrid 4 x 4"),
    ("join take.h5 nothing.h5 x.h5", 1, "expected a file, found none; check"),
    ("resample take.h5 x.h5", 2, 'Command "resample" parameter'),
    ("resample take.h5 x.h5 --rate 0Hz", 1, "expected a number above 0 Hz, got"),
    ("resample take.h5 x.h5 --rate -1kHz", 2, "--rate: expected a value, got -1kHz; none below 0"),
    ("resample take.h5 x.h5 --rate 1GHz", 1, "expected at most 1 MHz, got 1000 MHz"),
    ("resample take.h5 x.h5 --rate 0.5Hz", 1, "expected 40 Hz or more, twice the lowest frequency in use"),
    ("resample take.h5 x.h5 --rate 4000", 2, "expected a quantity such as 20Hz,"),
    ("gain take.h5 x.h5", 2, 'Command "gain" parameter --by'),
    ("gain take.h5 x.h5 --by loud", 1, "expected a factor such as 2 or"),
    ("gain take.h5 x.h5 --by 0", 1, "expected a factor other than 0, up to 1000 or 60dB, got 0"),
    ("gain take.h5 x.h5 --by 1000000", 1, "expected a factor other than 0, up to 1000 or 60dB, got"),
    ("gain take.h5 x.h5 --by -6", 1, "expected a factor other than 0, up to 1000 or 60dB, got -6; -6dB weakens"),
    ("gain take.h5 x.h5 --by 6 dB", 2, "unexpected: dB; options begin with --, a value with a space"),
    ("gain take.h5 x.h5 --by 2 --channels 16", 1, "expected comma-separated numbers from 0 to 15"),
    ("mask take.h5 x.h5 --channels 16", 1, "expected comma-separated numbers from 0 to 15"),
    ("mask take.h5 x.h5 --channels one", 1, "expected comma-separated numbers from 0 to 15"),
    ("mask take.h5 x.h5 --channels 1 --fill magic", 2, 'Invalid value "magic" for --fill.'),
    ("trim take.h5 x.h5 --share 2", 1, "expected a share of 0 to below 1,"),
    ("repair nothing.h5", 1, "expected a file, found none; check"),
    ("repair text.csv", 1, "expected an HDF5 file of midair,"),
    ("calibrate", 2, 'Command "calibrate" parameter'),
    ("calibrate raw.h5", 1, "expected a calibration for a"),
    ("calibrate raw.h5 --sensitivity 0mV/Pa", 1, "expected a number other than 0"),
    ("calibrate raw.h5 --peak 0Pa", 1, "expected a pressure above 0 and a"),
    ("calibrate raw.h5 --peak 1e9Pa", 1, "expected a pressure above 0 and at most 100000 Pa"),
    ("calibrate raw.h5 --peak 30Pa --sensitivity 20mV/Pa", 1, "expected --sensitivity or --peak,"),
    ("calibrate raw.h5 --calibration nothing.calibration.h5", 1, "expected a file, found none; check"),
    ("calibrate raw.h5 --calibration raw.h5", 1, "expected a calibration in it,"),
    ("calibrate take.h5 --band 20Hz", 2, "--band: expected two values with a space between, got 20Hz"),
    ("calibrate take.h5 --band 20Hz 470Hz 500Hz", 2, "unexpected: 500Hz; options"),
    ("calibrate take.h5 --band 20Hz 1kHz", 1, "expected 0 <= low < high <= 500"),
    ("calibrate show raw.h5", 1, "expected a calibration in it,"),
    ("calibrate show take.h5 page.pdf", 1, "expected a name that ends in .png"),
    ("calibrate measure take.h5", 1, "expected either separate files"),
    (
        "calibrate measure take.h5 --reference nothing.h5 --reference-sensitivity 50mV/Pa",
        1,
        "expected a file, found none; check",
    ),
    ("calibrate tone take.h5", 2, 'Command "calibrate tone" parameter'),
    ("calibrate tone take.h5 --pressure loud", 1, "expected a quantity such as 30Pa,"),
    ("calibrate tone take.h5 --pressure 114dB --frequency 900Hz", 1, "expected below 500 Hz, half the"),
    ("calibrate beam lsl: --device nothing", 2, "expected virtual:OBJECT,"),
    ("draw", 2, 'Command "draw" parameter SOURCE'),
    ("draw nothing.toml", 1, "expected a pattern in TOML, found no file"),
    ("draw take.h5", 1, "expected a pattern in TOML, got bytes"),
    ("draw nothing.adaptics", 1, "expected a pattern of the AdapTics Designer, found no file"),
    ("draw broken.toml --parameter size", 1, "expected NAME=NUMBER such as size=20, got 'size'"),
    ("play nothing.toml", 1, "expected a pattern in TOML, found no file"),
    ("draw broken.toml x.h5", 1, "expected a name that ends in .drive.h5"),
    ("draw broken.toml --wanted x.csv", 1, "expected a name that ends in .h5"),
    ("draw broken.toml --array openmpd --placement x.toml", 1, "expected --array autd3, got openmpd"),
    ("solve raw.h5", 1, "expected a calibration for a"),
    ("solve take.h5 out.h5", 1, "expected a name that ends in"),
    ("solve take.h5 nowhere/out.drive.h5", 1, "expected the folder"),
    ("solve take.h5 there.drive.h5", 1, "there.drive.h5: already exists;"),
    ("solve take.h5 x.drive.h5 --height 200m", 1, "expected 20mm to 1m of a palm"),
    ("solve take.h5 x.drive.h5 --height 200parsec", 1, "expected 20mm to 1m of a palm"),
    ("solve take.h5 x.drive.h5 --height 2mm", 1, "expected 20mm to 1m of a palm"),
    ("solve take.h5 x.drive.h5 --height nan", 2, "expected a quantity such as 200mm,"),
    ("solve take.h5 x.drive.h5 --points 3.5", 1, "expected control points that separate"),
    ("solve take.h5 x.drive.h5 --rate 3kHz", 1, "expected 40000 Hz over a whole"),
    ("solve take.h5 x.drive.h5 --rate 0Hz", 1, "expected a number above 0 Hz, got"),
    ("solve take.h5 x.drive.h5 --band 470Hz 20Hz", 1, "470"),
    ("solve take.h5 x.drive.h5 --band 20Hz 470mm", 2, "20Hz"),
    ("solve take.h5 x.drive.h5 --directivity laser", 2, "laser"),
    ("solve take.h5 x.drive.h5 --method magic", 1, "magic"),
    ("solve take.h5 x.drive.h5 --mapping magic", 1, "half-wave, constant-offset, slow-bias"),
    ("solve take.h5 x.drive.h5 --circle 3mm --circle-rate 30Hz", 1, "below 20 Hz, got 30 Hz"),
    ("solve take.h5 x.drive.h5 --gain -1", 1, "-1"),
    ("solve take.h5 x.drive.h5 --gain 0", 1, "gain: expected above 0 and at most 1000, got 0"),
    ("solve take.h5 x.drive.h5 --gain 1000000", 1, "gain: expected above 0 and at most 1000, got 1e+06"),
    ("solve take.h5 x.drive.h5 --points 0", 1, "0 x 0"),
    ("solve take.h5 x.drive.h5 --iterations 0 0", 1, "iterations"),
    ("solve take.h5 x.drive.h5 --temperature 99C", 1, "99"),
    ("solve take.h5 x.drive.h5 --mode bestest", 2, 'Invalid value "bestest" for'),
    ("solve take.h5 x.drive.h5 --mode best --settings there.drive.h5", 1, "expected --mode or --settings, got"),
    ("solve take.h5 x.drive.h5 --settings nothing.toml", 1, "expected settings in TOML, found"),
    ("solve take.h5 x.drive.h5 --settings broken.toml", 1, "expected settings in TOML, got:"),
    ("solve take.h5 x.drive.h5 --guard 20", 2, "expected a quantity such as 200mm,"),
    ("solve take.h5 x.drive.h5 --guard -20mm", 2, "--guard: expected a value, got -20mm; none below 0"),
    ("solve take.h5 x.drive.h5 --smooth -1", 1, "expected 0 or more, got -1"),
    ("solve take.h5 x.drive.h5 --robust 2mm", 2, "expected a quantity such as 2C,"),
    ("solve take.h5 x.drive.h5 --humidity 50", 2, "expected a quantity such as 50%,"),
    ("solve take.h5 x.drive.h5 --humidity 150%", 1, "humidity: expected 0 to 1, got 1.5; 1 is 100 %"),
    ("solve take.h5 x.drive.h5 --temperature 22K", 1, "expected 0 to 50 degrees Celsius,"),
    ("solve take.h5 x.drive.h5 --backend cuda", 1, "expected one of numpy, torch,"),
    ("solve take.h5 x.drive.h5 --jobs 0", 1, "expected 1 or more, got 0"),
    ("solve take.h5 x.drive.h5 --duration 0s", 1, "expected a part of 0 to 0.3 s, got"),
    ("solve take.h5 x.drive.h5 --start-at 2s", 1, "expected a part of 0 to 0.3 s, got"),
    ("solve take.h5 x.drive.h5 --array ultrahaptics", 2, 'Invalid value "ultrahaptics" for'),
    ("solve take.h5 x.drive.h5 --placement nothing.toml", 1, "expected a TOML file with the"),
    ("solve take.h5 x.drive.h5 --placement broken.toml", 1, "expected a TOML file with the"),
    ("solve take.h5 x.drive.h5 --fit skin", 2, 'Invalid value "skin" for --fit.'),
    ("solve take.h5 x.drive.h5 --amplitudes loud", 2, 'Invalid value "loud" for'),
    ("solve take.h5 x.drive.h5 --level loud", 2, "Invalid value for --level: unable"),
    ("solve take.h5 x.drive.h5 --start zeros", 2, 'Invalid value "zeros" for --start.'),
    ("play", 2, 'Command "play" parameter SOURCE'),
    ("play raw.h5", 1, "calibrat"),
    ("play take.h5 --correct-air --temperature 20C", 1, "--correct-air: expected a drive, got a recording"),
    ("play take.h5 --drive there.drive.h5", 1, "there.drive.h5: already exists"),
    ("play there.drive.h5 --mode quick", 1, "expected a recording with them, got there.drive.h5"),
    ("solve there.drive.h5", 1, "for a drive: midair solve writes it, midair play and show read it"),
    ("solve take.h5 x.drive.h5 --points 300", 1, "use at most 272 x 272"),
    ("solve take.h5 x.drive.h5 --points 4000 --pitch 100um", 1, "or fewer points, about"),
    ("solve take.h5 x.drive.h5 --mode best --method lm", 1, "got cells; choose"),
    ("solve take.h5 x.drive.h5 --level 5", 1, "expected above 0 and at most 1"),
    ("loop take.h5 x.html --points 4000", 1, "use at most 272 x 272"),
    ("study new x --template paper --participants 100000000", 1, "reduce participants or repetitions"),
    ("play there.drive.h5 there.h5", 2, "unexpected: there.h5; options"),
    ("play there.drive.h5 --device autd", 2, "expected virtual, autd3,"),
    ("play there.drive.h5 --output nowhere/x.h5", 1, "expected the folder"),
    ("play there.drive.h5 --output y.h5 --repeats 1000000", 1, "--repeats: expected 1 to 100000, got 1e+06"),
    ("play there.drive.h5 --humidity 50%", 1, "--temperature"),
    ("play there.drive.h5 --temperature 22mm", 2, "expected a quantity such as 22C,"),
    ("play there.drive.h5 --profile nothing", 1, "expected one of occupational-110,"),
    ("play there.drive.h5 --profiles broken.toml", 1, "expected TOML, got: Invalid value"),
    ("live virtual:towel", 2, "unexpected: virtual:towel; options begin with --"),
    ("exposure take.h5", 1, "expected a midair drive, got"),
    ("exposure there.drive.h5 --profile nothing", 1, "expected one of occupational-110,"),
    ("exposure there.drive.h5 --repeats 0", 1, "--repeats"),
    ("stop --device nothing", 2, "expected virtual, autd3,"),
    ("compare take.h5", 2, 'Command "compare" parameter'),
    ("compare take.h5 small.h5", 1, "expected the original's (4, 4)"),
    ("compare take.h5 raw.h5", 1, "expected a calibration for a"),
    ("loop raw.h5", 1, "expected a calibration for a"),
    ("loop take.h5 report.pdf", 1, ".html"),
    ("loop take.h5 report.html --corrections -1", 1, "expected 0 to 100 amplitude and waveform corrections,"),
    ("loop take.h5 report.html --corrections 1000000", 1, "expected 0 to 100 amplitude and waveform corrections,"),
    ("loop take.h5 nowhere/report.html", 1, "expected the folder"),
    ("budget raw.h5", 1, "expected a calibration for a"),
    ("budget take.h5 --silencer loud", 2, 'Invalid value "loud" for'),
    ("demo there", 1, "there: contains an earlier demo; give"),
    ("demo x --object-name cat", 2, "cat"),
    ("demo x --duration 0s", 1, "--duration"),
    ("paper --figure 5", 2, 'Invalid value "5" for --figure.'),
    (
        "paper --figure 4 --duration 50ms",
        1,
        "duration: expected a multiple of 40 ms, 80 ms or more, for figure 4, got 50 ms",
    ),
    ("paper --mode loud", 2, 'Invalid value "loud" for --mode.'),
    ("paper --things cat --fidelity", 1, "cat"),
    ("identify", 2, 'Command "identify" parameter'),
    ("identify virtual:cats", 2, "expected brush, sponge or towel"),
    ("doctor --verbos", 2, "Unknown option: --verbos."),
    ("study new t --participants 0", 1, "expected 1 or more, got 0"),
    ("study new t --source nothing.toml", 1, "expected the TOML of a study, found"),
    ("study new t --source broken.toml", 1, "expected TOML, got: Invalid value"),
    ("study new !!!", 1, "letters"),
    ("study new t --template nonsense", 2, 'Invalid value "nonsense" for --template'),
    ("study new t --drives nowhere", 1, "expected brush-grooved.drive.h5,"),
    ("study new t --mode fast", 2, 'Invalid value "fast" for --mode'),
    ("study plan nothing", 1, "expected a study with a plan.json;"),
    ("study withdraw nothing 1 --force", 1, "expected a study with a plan.json;"),
    ("study withdraw nothing", 2, "PARTICIPANT"),
    ("study run nothing", 1, "expected a study with a plan.json;"),
    ("study run nothing --participant 1", 1, "expected a study with a plan.json;"),
    ("study analyse nothing", 1, "expected a table, the file does not exist"),
    ("study analyse five.csv", 1, "expected `presented` and"),
    ("study export nothing out", 1, "expected a study with a plan.json;"),
    ("study verify nothing", 1, "expected a study with a plan.json;"),
    ("study power paired", 2, 'Command "study power" parameter'),
    ("study power guess --effect 0.8", 2, 'Invalid value "guess" for TEST.'),
    ("study power paired --effect 0", 1, "expected to reach 0.8 with d_z = 0"),
    ("study power paired --effect 0.8 --power 2", 1, "--power"),
    ("sweep patterns", 2, 'Command "sweep patterns" parameter'),
    ("sweep patterns x.zarr --count 0", 1, "expected 1 to 65535 (curves: from"),
    ("sweep patterns x.zarr --strength loud", 2, "Invalid value for --strength:"),
    ("sweep patterns x.txt", 1, ".zarr"),
    ("sweep recordings x.zarr", 1, "expected recordings after the name"),
    ("sweep recordings x.zarr nothing.h5", 1, "expected a file, found none; check"),
    ("sweep recordings x.zarr take.h5 --vary heigth=150mm", 1, "--vary heigth: Unknown option:"),
    ("sweep recordings x.zarr take.h5 --vary height", 1, "expected OPTION=VALUE,VALUE such"),
    ("sweep report nothing.zarr", 1, "expected a sweep, found none; create"),
    ("completion tcsh", 2, 'Invalid value "tcsh" for SHELL.'),
)
"""Command line in a folder with `files`, exit status, and words of the error line."""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mistakes")
    with chdir(folder):
        rng = np.random.default_rng(3)
        samples = rng.normal(size=(300, 4, 4))
        for name in ("raw.h5", "take.h5", "there.h5"):
            save(Recording(samples=samples, rate=1000), name)
        assert run(["calibrate", "take.h5", "--peak", "30Pa"]) == 0
        quick = "--mode paper --method naive --duration 10ms --lead 0s"
        assert run(["solve", "take.h5", "there.drive.h5", *quick.split()]) == 0
        small = SensorGrid(rows=2, columns=2)
        save(Recording(samples=samples[:, :2, :2], rate=1000, unit="Pa", sensor=small), "small.h5")
        soundfile.write("song.wav", 0.5 * np.sin(np.arange(4000) / 9), 8000)
        Path("text.csv").write_text("this is\nno recording\n")
        Path("empty.h5").touch()
        Path("truncated.h5").write_bytes(Path("take.h5").read_bytes()[:2000])
        Path("broken.toml").write_text("a = = 3\n")
        np.savetxt("five.csv", rng.normal(size=(50, 5)), delimiter=",", header="a,b,c,d,e", comments="")
        gaps = rng.normal(size=(50, 16))
        gaps[3, 3] = np.nan
        np.savetxt("gaps.csv", gaps, delimiter=",")
        Path("x.hjif").write_text("{}")
        Path("x.m4a").write_text("x")
        Path("there").mkdir()
        Path("there/report.html").write_text("x")
    return folder


def state(folder):
    return {path: path.stat().st_mtime_ns for path in sorted(folder.rglob("*"))}


@pytest.mark.parametrize(("typed", "status", "words"), MISTAKES, ids=[typed for typed, _, _ in MISTAKES])
def test_a_mistake_is_one_line(files, monkeypatch, capsys, one_line, typed, status, words):
    monkeypatch.chdir(files)
    before = state(files)
    capsys.readouterr()
    assert run(shlex.split(typed)) == status
    line = one_line()
    assert words in line
    assert "error in midair" not in line
    assert state(files) == before


def test_there_are_as_many_as_were_tried():
    assert len(MISTAKES) >= 150
    assert len({typed for typed, _, _ in MISTAKES}) == len(MISTAKES)
