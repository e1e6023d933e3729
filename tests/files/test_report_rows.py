import json

from midair.files import csv_text, for_json


def test_rows_become_lines_with_six_digits():
    rows = [{"a": 1, "b": 0.123456789, "c": "x,y"}, {"a": 2, "b": float("inf"), "c": None}]
    assert csv_text(rows) == 'a,b,c\n1,0.123457,"x,y"\n2,inf,\n'


def test_non_finite_numbers_become_null_at_every_depth():
    value = {"a": float("nan"), "b": [1.0, float("inf"), ("x", float("-inf"))], 3: {"c": None}}
    assert for_json(value) == {"a": None, "b": [1.0, None, ["x", None]], "3": {"c": None}}
    json.dumps(for_json(value), allow_nan=False)
