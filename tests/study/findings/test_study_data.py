import pytest

from midair.errors import InputError
from midair.study.findings.study_data import data_of_columns

PEOPLE = ["1"] * 4


@pytest.mark.parametrize(
    ("presented", "answered", "why"),
    [
        ([1.0, 2, 3, 1], ["1", "2", "n/a", "1"], r"column 'b': .* got 'n/a' where the other column has numbers"),
        (["1", "n/a", "2", "1"], [1.0, 2, 3, 1], r"column 'a': .* got 'n/a'"),
        ([1.0, 2, 3, 1], ["brush", "towel", "brush", "brush"], "got 'brush' where"),
    ],
)
def test_labels_of_mixed_kinds_are_refused(presented, answered, why):
    with pytest.raises(InputError, match=why):
        data_of_columns({"p": PEOPLE, "a": presented, "b": answered}, participant="p", presented="a", answered="b")


@pytest.mark.parametrize("labels", [["brush", "n/a", "towel", "brush"], [1.0, 2.0, 3.0, 1.0]])
def test_labels_of_one_kind_are_accepted(labels):
    data = data_of_columns({"p": PEOPLE, "a": labels, "b": labels[::-1]}, participant="p", presented="a", answered="b")
    assert data.choices["presented"].tolist() == labels
