"""Tables as programs, oscilloscopes, boards and phones export them: a known tone comes back, or a question.

The forms were made from documentation and from excerpts of public files; no file of others is here.
"""

import numpy as np
import pytest

from midair.errors import BrokenFileError, InputError
from midair.files import open_take
from midair.recordings import Mending

T = np.arange(300) / 1000
A = 0.5 * np.sin(2 * np.pi * 100 * T)
B = 0.3 * np.cos(2 * np.pi * 60 * T)
WHOLE = (512 + 300 * A).astype(int)
EPOCH = 1_696_000_000


def rows(*columns, sep=",", end="\n"):
    return "".join(sep.join(row) + end for row in zip(*columns, strict=True))


def f(values, form="{:.7f}", decimal="."):
    return [form.format(value).replace(".", decimal) for value in values]


def stamps(form="12:34:{:06.3f}"):
    return [form.format(1 + time) for time in T]


def german(values, form="{:,.7f}"):
    return [form.format(value).translate(str.maketrans(",.", ".,")) for value in values]


def over(mark):
    return [mark if i == 50 else text for i, text in enumerate(f(A))]


MS, COUNT = f(1e3 * T), [str(i) for i in range(len(T))]
LVM = "LabVIEW Measurement\t\nSeparator\tTab\nTime\t12:00:00.0\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
LVM += "Y_Unit_Label\tVolts\tVolts\t\nDelta_X\t1.000000E-3\t1.000000E-3\t\n***End_of_Header***\t\t\t\n"
TEK = [
    "Record Length,3.0e+02",
    "Sample Interval,1.0e-03",
    "Trigger Point,0",
    ",",
    ",",
    "Source,CH1",
    "Vertical Units,V",
]
SIGNALS = '# OpenSignals\n# {"x": {"column": ["nSeq", "DI", "CH1"], "sampling rate": 1000, "resolution": [4, 1]}}\n'
ODF = "%OpenBCI Raw EXG Data\n%Number of channels = 1\n%Sample Rate = 1000 Hz\n"
LECROY = "LECROYWS104,0,Waveform\nSegments,1,SegmentSize,300\nSegment,TrigTime,TimeSinceSegment1\n#1,24-Feb-2016,0\n"
ACTIGRAPH = "---- Data File Created By ActiGraph GT3X+ date format M/d/yyyy at 30 Hz ----\nSerial Number: N\n----\n"
INSTEK = "Format,2.0B\nMemory Length,300\nSource,CH1\nVertical Units,V\nSampling Period,1.0E-03\nWaveform Data,\n"
ACQ = "graph1.acq\n1 msec/sample\n1 channels\nForce\nVolts\n"
DAYS = stamps("2025-05-01T12:00:{:06.3f}Z")

FORMS = {
    "PicoScope": ("Time,Channel A,Channel B\n(ms),(V),(mV)\n\n" + rows(MS, f(A), f(1e3 * B)), "read V"),
    "PicoScope, overflow": ("Time,Channel A\n(ms),(V)\n\n" + rows(MS, over("∞")), "mend"),
    "PicoScope, German": ("Zeit;Kanal A\n(ms);(V)\n\n" + rows(german(1e3 * T), german(A), sep=";"), "read V"),
    "phyphox": ('"Time (s)","Acceleration x (m/s^2)"\n' + rows(f(T, "{:.9E}"), f(A)), "read"),
    "phyphox, semicolon": (
        '"Time (s)";"Acceleration x (m/s^2)"\n' + rows(f(T, "{:.9E}", ","), german(A), sep=";"),
        "read",
    ),
    "phyphox, tab": ('"Time (s)"\t"Acceleration x (m/s^2)"\n' + rows(f(T, "{:.9E}"), f(A), sep="\t"), "read"),
    "Sensor Logger": (
        "time,seconds_elapsed,z,y\n" + rows([f"{EPOCH}{i:03d}123456" for i in range(300)], f(T + 0.1), f(A), f(B)),
        "read",
    ),
    "date in us": ("timestamp,ch0\n" + rows([f"{EPOCH}{i:03d}456" for i in range(300)], f(A)), "read"),
    "date in s": ("timestamp,ch0\n" + rows(f(EPOCH + T, "{:.6f}"), f(A)), "read"),
    "micros": ("micros,a0\n" + rows(f(123456 + 1e6 * T, "{:.0f}"), f(A)), "read"),
    "time_us": ("time_us,a0\n" + rows(f(123456 + 1e6 * T, "{:.0f}"), f(A)), "read"),
    "a counter of 32 bits": ("time_us,a0\n" + rows(f((2**32 - 1e5 + 1e6 * T) % 2**32, "{:.0f}"), f(A)), "read"),
    "ISO 8601": ("time,ch0\n" + rows(DAYS, f(A)), "read"),
    "Saleae": ("Time [s],Channel 0\n" + rows(f(T), f(A)), "read"),
    "Rigol": ("X,CH1,Start,Increment,\nSequence,VOLT,-2.0e-01,1.000000e-03\n" + rows(COUNT, f(A), end=",\n"), "read V"),
    "Tektronix": (rows(TEK + [","] * 293, ["Points", "s", *[""] * 298], f(T), f(A), end=",\n"), "read V"),
    "pandas with its index": (",ch0,ch1\n" + rows(COUNT, f(A), f(B)), "rate"),
    "Excel's separator": ("sep=;\ntime;a\n" + rows(german(T), german(A), sep=";"), "read"),
    "UTF-16": (("time [s]\ta [V]\n" + rows(f(T), f(A), sep="\t")).encode("utf-16"), "read V"),
    "byte-order mark": (("time [s],a [V]\n" + rows(f(T), f(A))).encode("utf-8-sig"), "read V"),
    "Arduino monitor": (rows(stamps(), [f"{n},{n + 1}" for n in WHOLE], sep=" -> "), "read count"),
    "Arduino plotter": (rows([f"a0:{n}" for n in WHOLE], [f"a1:{n + 1}" for n in WHOLE]), "rate count"),
    "LabVIEW": (LVM + "X_Value\tVoltage_0\tVoltage_1\tComment\n" + rows(f(T), f(A), f(B), sep="\t"), "read V"),
    "OpenSignals": (SIGNALS + rows([str(i % 16) for i in range(300)], map(str, WHOLE), sep="\t"), "read count"),
    "Audacity": ("Sample Rate: 1000 Hz. Sample values on linear scale. 1 channel (mono).\n" + rows(f(A)), "read"),
    "comments": ("# recorded 2025-05-01\n# fs = 1000 Hz\ntime,a\n" + rows(f(T), f(A)), "read"),
    "thousands": ("time;a\n" + rows(german(T), german(1e4 * A, "{:,.3f}"), sep=";"), "read 10000"),
    "Excel, two digits of time": ("time,a\n" + rows(f(T, "{:.2f}"), f(A)), "read"),
    "hours, minutes, seconds": ("Time,a\n" + rows(stamps(), f(A)), "read"),
    "an overflow": ("time,a\n" + rows(f(T), over("OVER")), "mend"),
    # Ten more, of public repositories.
    "LeCroy": (LECROY + "Time,Ampl\n" + rows(f(T), f(A)), "read"),
    "Rohde & Schwarz": ("in s,C1 in V\n" + rows(f(T, "{:.7E}"), f(A, "{:.7E}")), "read V"),
    "Digilent": ("#Digilent WaveForms\n#Sample rate: 1000Hz\n\nTime (s),Channel 1 (V)\n" + rows(f(T), f(A)), "read V"),
    "OpenBCI": (
        ODF
        + "Sample Index, EXG Channel 0, Timestamp, Timestamp (Formatted)\n"
        + rows(
            [str(i % 256) for i in range(300)],
            f(A),
            f(EPOCH + T // 0.01 / 100),
            stamps("2024-01-01 10:00:{:06.3f}"),
            sep=", ",
        ),
        "read",
    ),
    "MetaBase": (
        "epoch (ms),time (-13:00),elapsed (s),x-axis (g)\n"
        + rows([f"{EPOCH}{i:03d}" for i in range(300)], stamps("2019-01-01T10.00.{:06.3f}"), f(T, "{:.3f}"), f(A)),
        "read",
    ),
    "PulseView": ("; CSV generated by libsigrok\n; Samplerate: 1 kHz\n" + rows(f(A), f(B)), "read"),
    "Moku": (
        "% Moku:Go\n% Acquisition rate: 1.0e+03 Hz\n% Time (s), Channel A (V)\n" + rows(f(T), f(A), sep=", "),
        "read V",
    ),
    "ActiGraph": (ACTIGRAPH + "Accelerometer X,Accelerometer Y\n" + rows(f(A), f(B)), "rate"),
    "Siglent": ("Record Length,Analog:300\nSample Rate,1000.0\nSecond,Volt\n" + rows(f(T), f(A)), "read V"),
    "Hantek": ("nr,time,ch1\n" + rows(COUNT, f(T, "{:g}"), f(A)), "read"),
    # And ten more.
    "LabChart": (
        "Interval=\t0.001 s\nChannelTitle=\tForce\tEMG\nRange=\t10.000 V\t5.000 mV\n"
        + rows(f(T), f(A), f(B), sep="\t"),
        "read",
    ),
    "AcqKnowledge": (ACQ + "CH1\t\n300\t\n" + rows(f(A), sep="\t", end="\t\n"), "read"),
    "Empatica": (rows(*[[str(EPOCH), "1000.0", *f(values, "{:.6f}")] for values in (A, B)], sep=", "), "read"),
    "Shimmer": (
        '"sep=\t"\nS_Timestamp_Unix_CAL\tS_Accel_LN_X_CAL\t\nms\tm/(s^2)\t\n'
        + rows(f(1e3 * (EPOCH + T), "{:.3f}"), f(A), sep="\t", end="\t\n"),
        "read",
    ),
    "Xsens": (
        "// Update Rate: 1000.0Hz\nPacketCounter\tSampleTimeFine\tAcc_X\n"
        + rows([str(23593 + i) for i in range(300)], [""] * 300, f(A), sep="\t"),
        "read",
    ),
    "Delsys": ("X[s],EMG 1 [V],X[s],EMG 2 [V]\n" + rows(f(T), f(A), f(T), f(B)), "read V"),
    "GW Instek": (INSTEK + rows(f(A), end=",\n"), "read V"),
    "Power Profiler": ("Timestamp(ms),Current(uA)\n" + rows(f(1e3 * T, "{:.3f}"), f(A)), "read"),
    "Tera Term": (rows(stamps("[2025-05-01 12:00:{:06.3f}]"), f(A), sep=" "), "read"),
    "Yokogawa": ('"Header Size",10\n"Model Name","DLM2000"\n\n' + rows([""] * 300, f(A), end=",\n"), "refused"),
}
"""Text, what comes (read, a question for the rate, mend, or refused), and the unit or scale that the text states."""


def tone(take):
    samples = np.asarray(take.recording.samples).ravel()
    wave = samples - samples.mean()
    spectrum = np.abs(np.fft.rfft(wave * np.hanning(len(wave)), 2**15))
    return spectrum.argmax() * take.recording.rate / 2**15, 2 * spectrum.max() / np.hanning(len(wave)).sum()


def opened(path, stated, **given):
    """The first channel of a file, whose unit is asked for if the file does not state it."""
    unit = {} if {"V", "count"} & set(stated) and "count" not in stated else {"unit": "count"}
    unit = {"scale": 1.0} if not {"V", "count"} & set(stated) else unit
    return open_take(path, **{"channels": ["0"], **unit, **given})


def test_a_known_tone_comes_back_from_fifty_forms_or_one_fact_is_asked(tmp_path):
    wrong, came = {}, []
    for name, (text, expected) in FORMS.items():
        path = tmp_path / ("a.lvm" if name == "LabVIEW" else "a.csv")
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        result, *stated = expected.split()
        given = {"rate": {"rate": 1000.0}, "mend": {"mending": Mending()}}.get(result, {})
        if result == "refused":
            with pytest.raises(BrokenFileError, match="expected a number, got"):
                opened(path, stated)
            came.append(result)
            continue
        level = {"10000": 5000, "count": 150}.get(stated[0], 0.5) if stated else 0.5
        try:
            if given:
                with pytest.raises(InputError, match={"rate": "frame rate", "mend": "--mend"}[result]):
                    opened(path, stated)
            take = opened(path, stated, **given)
            assert tone(take) == (pytest.approx(100, rel=2e-3), pytest.approx(level, rel=0.02))
            assert take.recording.unit == {"V": "V", "count": "count"}.get(stated[0] if stated else "", "Pa")
            assert take.recording.rate == pytest.approx(1000, rel=2e-3)
            assert 290 <= take.recording.frames <= 300
            came.append(result)
        except (AssertionError, InputError, OSError) as fault:
            wrong[name] = str(fault)[:300]
    assert wrong == {}
    assert (came[:30].count("read"), came[:40].count("read"), came.count("read"), len(came)) == (26, 35, 44, 50)


def test_two_readings_or_wrong_options_are_refused(tmp_path, subtests):
    for text, given, said in [
        ("0,1\n0.001,0.9\n0.002,0.8\n", {}, "2 channels and does not state their layout"),
        ("time;a\n0;1,234\n1;2,345\n", {}, "a comma of decimals, and of thousands; give decimal="),
        ("0,001,0,5\n0,002,0,6\n0,003,0,7\n", {}, "commas of decimals, and between columns; give decimal="),
        ("X_Value\ta\tX_Value\tb\n0.1\t1\t0.1\t1\n0.2\t2\t0.3\t2\n", {}, "one time for all channels"),
        ("a:1,b:2\na:1,c:2\n", {}, "labels a, b, got others in line 2"),
        ("time,a\n12:00:01,1\n12:00:02,2\n", {"unit_row": 7}, "unit_row: expected a line before"),
        ("# Sample rate: 1 parrot\na\n1\n2\n", {}, "does not state its frame rate"),
        ("time,a\n0.1,1\n0.2,2\n", {"separator": "dash"}, "separator: expected tab"),
        ("time,a\n0.1,1\n0.2,2\n", {"skip": -1}, "lines from 0 on"),
        ("time,a\n0.1,1\n0.2,2\n", {"time": "b"}, "expected a channel by name"),
        ("time,a [mV]\ns,V\n0.1,1\n0.2,2\n", {}, r"one unit of column 'a \[mV\]', got V in line 2"),
        ("time [s],a\n0.1,0x10\n0.2,0x11\n0.3,0x12\n", {}, "a channel beside the time, got none.*'a' has no numbers"),
    ]:
        (tmp_path / "a.csv").write_text(text)
        with subtests.test(text=text), pytest.raises((InputError, OSError), match=said):
            open_take(tmp_path / "a.csv", scale=1.0, **given)


def test_options_decide_how_a_text_is_read(tmp_path, subtests):
    for text, given, names, unit in [
        ("x\nt;a\nV;mV\n1;1,234\n2;2,345\n", {"skip": 1, "decimal": "comma", "time": "none"}, "t, a", "V"),
        ("t|a\n1|2\n2|3\n", {"separator": "|", "time": "none", "unit": "V"}, "t, a", "V"),
        ("u,v\nV,V\nbar,bar\n1,2\n2,3\n", {"unit_row": 2}, "bar, bar", "V"),
        ("u,v\nV,V\n1,2\n2,3\n", {"unit_row": 0, "unit": "count"}, "V, V", "count"),
        ("0,1,2\n0.5,1.5,2.5\n0.6,1.6,2.6\n", {"unit": "V"}, "0, 1, 2", "V"),
        ("a,b,c\n1,5,2\n2,,3\n3,,4\n4,,5\n", {"unit": "V"}, "a, c; without numbers in the second half", "V"),
        ("a,b,c\n1,0.1,x\n2,0.2,y\n3,0.3,z\n", {"unit": "V", "time": "b"}, "a", "V"),
    ]:
        with subtests.test(text=text):
            (tmp_path / "a.csv").write_text(text)
            take = open_take(tmp_path / "a.csv", **({"rate": 10.0} | given | {"channels": ["0"]}))
            assert f"Columns: {names}" in take.report[1].replace(" [V]", "").replace(" [mV]", "")
            assert take.recording.unit == unit


def test_thousands_and_minus_as_people_write_them(tmp_path):
    for mark in ("'", "’", "\xa0", "\u202f"):
        text = f"t [s];a [mV]\n0;1{mark}234,5\n0,5;\u22122{mark}000,25\n"
        (tmp_path / "a.csv").write_text(text, encoding="utf-8")
        assert open_take(tmp_path / "a.csv").recording.samples.ravel() == pytest.approx([1.2345, -2.00025])


def test_a_column_that_increases_evenly_is_reported_and_a_rate_ends_where_its_line_does(tmp_path):
    (tmp_path / "a.csv").write_text(rows(f(T), f(A)))
    take = open_take(tmp_path / "a.csv", rate=1000.0, unit="V", channels=["0"])
    assert "column 1 increases evenly, as a time or a counter does (--time)" in take.report[1]
    assert open_take(tmp_path / "a.csv", time="0", unit="V").recording.frames == 300
    # A rate ends where its line does: before, a step of 1.0E-03 above a line of text gave 1 Hz.
    for after in ("Waveform Data", "1000 points"):
        (tmp_path / "a.csv").write_text(f"Sampling Period,1.0E-03\n{after},\n" + rows(f(A), end=",\n"))
        assert open_take(tmp_path / "a.csv", unit="V").recording.rate == 1000


def test_the_report_states_how_a_text_was_read(tmp_path):
    (tmp_path / "a.csv").write_bytes(
        ("Zeit;Kanal A\n(µs);(V)\n" + rows(german(1e6 * T), german(A), sep=";")).encode("cp1252")
    )
    report = open_take(tmp_path / "a.csv").report
    assert report[:2] == (
        "Text read as Windows-1252, separator semicolon, decimal comma, numbers from line 3 on, units in line 2.",
        "Columns: Zeit [µs], Kanal A [V].",
    )
    assert report[-1] == "Rate 1000 Hz: 100 % of 300 rows used, 0 % of 300 frames filled."
