"""Messages of Grbl, with the examples of its documentation (gnea/grbl, doc/markdown/interface.md)."""

import pytest

from midair.devices.motion_stages.grbl import parse_status, with_meaning


def test_a_report_with_everything():
    report = parse_status("<Hold:0|MPos:-2.500,0.000,11.000|FS:500,8000|Pn:PZ|WCO:0.000,1.551,5.664|Ov:100,100,100>")
    assert report is not None
    assert (report.state, report.position, report.work) == ("Hold:0", (-2.5, 0.0, 11.0), False)
    assert (report.feed, report.pins, report.offset) == (500.0, "PZ", (0.0, 1.551, 5.664))


def test_a_report_of_the_work_without_a_spindle():
    report = parse_status("<Run|WPos:1.0,2.0,3.0,4.0|F:120>")
    assert report is not None
    assert (report.work, report.position, report.feed) == (True, (1.0, 2.0, 3.0), 120.0)


@pytest.mark.parametrize(
    "line",
    ["ok", "<Idle>", "<Idle|MPos:1,2>", "<Idle|MPos:a,b,c|FS:0,0>", "<Idle|MPos:0,0,0", "<Sdle|MPos:0,0,0|FS:0,0>", ""],
)
def test_what_is_no_report_is_none(line):
    assert parse_status(line) is None


def test_alarms_and_errors_have_explanations():
    assert with_meaning("ALARM:1") == "ALARM:1, a limit switch was hit, the position is probably lost"
    assert with_meaning("error:15") == "error:15, the target is beyond the machine's travel"
    assert with_meaning("ALARM:77") == "ALARM:77"
