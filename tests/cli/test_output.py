import json

from midair.cli.output import print_table
from midair.files import FormatLoss
from midair.table import Details, Row, printed


def test_a_table_is_printed_or_json(capsys):
    table = [
        Row("rate", 1000.0, key="rate_hz", text="1000 Hz"),
        Row("frames", 3, text="3 of 4"),
        Row("note", None, text=""),
        ("source", "towel"),
        ("age", ""),
        {"kind": "take"},
        Details([Row("more", 7), Details([("most", "all")])]),
    ]
    made = []

    def later():
        made.append(1)
        return Details([Row("later", 8)])

    table.append(later)
    assert printed(table) == [("rate", "1000 Hz"), ("frames", "3 of 4"), ("source", "towel")]
    assert not made
    assert printed(table, all=True)[3:] == [("more", "7"), ("most", "all"), ("later", "8")]
    print_table(table, json=True)
    values = {"rate_hz": 1000.0, "frames": 3, "note": None, "kind": "take", "more": 7, "later": 8, "simulated": False}
    assert json.loads(capsys.readouterr().out) == values
    how = {"notes": ["cut"], "lost": [FormatLoss(what="rate", text="No rate.")]}
    print_table(table, json=True, simulated=True, **how)
    more = {"simulated": True, "notes": ["cut"], "lost": [{"what": "rate", "text": "No rate."}]}
    assert json.loads(capsys.readouterr().out) == values | more
    print_table(table, json=False, answer="a towel", simulated=True, **how)
    said = capsys.readouterr().out
    assert said.startswith("SIMULATED  a towel\nrate ")
    assert all(word in said for word in ("frames", "note    cut", "lost    No rate."))
    print_table(table, json=False, simulated=False)
    assert "SIMULATED" not in "".join(capsys.readouterr())
