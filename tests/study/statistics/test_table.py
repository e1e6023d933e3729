import numpy as np
import pandas as pd
import pytest

from midair.errors import InputError, NonFiniteError, ShapeError
from midair.study import Table
from midair.study.statistics.table import cell_means


def test_a_frame_a_dict_and_a_table_are_the_same():
    columns = {"who": ["a", "b"], "n": [1, 2]}
    for table in (Table.of(columns), Table.of(pd.DataFrame(columns)), Table.of(Table(columns))):
        assert table.rows == [{"who": "a", "n": 1}, {"who": "b", "n": 2}]
        assert table.row({"who": "b"})["n"] == 2
        assert list(table) == ["who", "n"]
        assert pd.DataFrame(dict(table)).equals(pd.DataFrame(columns))


def test_columns_cannot_change():
    values = np.array([1.0, 2])
    table = Table({"x": values})
    values[0] = 9
    assert table["x"][0] == 1
    with pytest.raises(ValueError, match="read-only"):
        table["x"][0] = 3


def test_rows_by_their_values():
    table = Table({"x": [1, 1, 2], "y": list("abb")})
    assert table.where({"x": 1, "y": "b"}).rows == [{"x": 1, "y": "b"}]
    assert table.where({"x": 7}).height == 0
    with pytest.raises(InputError, match="expected one row"):
        table.row({"x": 1})
    with pytest.raises(InputError, match="column 'z'"):
        table.where({"z": 1})


def test_what_is_no_table():
    with pytest.raises(ShapeError, match="one length"):
        Table({"a": [1], "b": [1, 2]})
    with pytest.raises(ShapeError, match="one axis"):
        Table({"a": [[1]]})
    with pytest.raises(NonFiniteError, match="missing"):
        Table.of(pd.DataFrame({"a": ["x", None]}))
    assert Table({}).height == 0


def test_cell_means_average_the_trials():
    table = {"v": [1.0, 3, 5, 7, 9, 11], "who": list("aaabbb"), "x": list("sstsst")}
    cells = cell_means(table, value="v", participant="who", within=["x"])
    assert cells.mean.tolist() == [[2, 5], [8, 11]]
    assert (cells.participants, cells.levels) == (("a", "b"), (("s", "t"),))
