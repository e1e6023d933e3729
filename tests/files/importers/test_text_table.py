import numpy as np
import pytest

from midair.errors import BrokenFileError, NonFiniteError
from midair.files.importers.csv_file import read_table


@pytest.mark.parametrize(
    "text",
    [
        "a,b,c\n1,2,3\n4,5,6\n",
        "a, b, c\n1, 2, 3\n4, 5, 6",
        "a,b,c\r\n1,2,3\r\n4,5,6\r\n",
        "a,b,c\n1,2,3,\n4,5,6,\n",
        "a,b,c,\n1,2,3,\n4,5,6,\n",
        "a;b;c\n1;2;3\n4;5;6\n",
        "a\tb\tc\n1\t2\t3\n4\t5\t6\n",
        "# made by a machine, 2019\na,b,c\n\n1,2,3\n  \n4,5,6\n\n",
        '"a","b","c"\n"1","2","3"\n4,5,6\n',
        " a ,b , c \n 1 ,2.0,3e0\n4,+5,6\n",
    ],
    ids=[
        "plain",
        "spaces after commas",
        "line ends of Windows",
        "rows end in a comma",
        "names and rows end in a comma",
        "semicolons",
        "tabs",
        "comments and empty lines",
        "quotes",
        "spaces and signs",
    ],
)
def test_reads_every_dialect_alike(text, tmp_path):
    table = read_table(text, tmp_path)
    assert table.names == ("a", "b", "c")
    np.testing.assert_array_equal(table.values, [[1, 2, 3], [4, 5, 6]])


def test_reads_rows_without_names(tmp_path):
    table = read_table("1,2,\n3,4,\n", tmp_path)
    assert table.names == ()
    np.testing.assert_array_equal(table.values, [[1, 2], [3, 4]])


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("", BrokenFileError, "expected rows of numbers, got none"),
        ("a,b\n", BrokenFileError, "expected rows of numbers, got none"),
        ("a,b\n1,2\n3\n", BrokenFileError, "expected 2 fields in line 3, got 1"),
        ("a,b\n1,2,3\n", BrokenFileError, "expected 2 fields in line 2, got 3"),
        ("a,b\n1,2,,\n", BrokenFileError, "expected 2 fields in line 2, got 4"),
        ("a,b\n1,x\n", BrokenFileError, "got 'x' in line 2, column 'b'"),
        ("a,b\n1,1_000\n", BrokenFileError, "got '1_000' in line 2, column 'b'"),
        ('a;b\n1;"2,5"\n', BrokenFileError, "write decimals with a point"),
        ("a,b\n1,\n", NonFiniteError, "empty field in line 2, column 'b'"),
        ("a,b\n,1\n", NonFiniteError, "empty field in line 2, column 'a'"),
        ("a,b\n1,2\n3,nan\n", NonFiniteError, "got nan in line 3, column 'b'"),
        ("1,2\n3,inf\n", NonFiniteError, "got inf in line 2, column 2"),
    ],
)
def test_errors_name_the_place(text, error, message, tmp_path):
    with pytest.raises(error, match=message):
        read_table(text, tmp_path)
