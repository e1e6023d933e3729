from dataclasses import dataclass, field
from typing import Literal

import pytest

from midair.errors import InputError
from midair.files import from_plain, to_plain


@dataclass(frozen=True)
class Inner:
    size: float = 1.0

    def __post_init__(self):
        if self.size < 0:
            raise InputError(f"size: expected 0 or more, got {self.size:g}")


@dataclass(frozen=True)
class Outer:
    kind: Literal["a", "b"] = "a"
    pair: tuple[float, float] = (0.0, 1.0)
    many: int | tuple[int, int] | None = None
    inner: Inner = field(default_factory=Inner)
    other: float | Inner | None = None


@pytest.mark.parametrize(
    "value",
    [Outer(), Outer(kind="b", pair=(2.0, 3.0)), Outer(many=(1, 2), other=Inner(size=4.0)), Outer(many=3, other=0.5)],
)
def test_plain_values_are_converted_back(value):
    assert from_plain(Outer, to_plain(value)) == value


def test_none_is_left_out_and_tuples_are_lists():
    assert to_plain(Outer()) == {"kind": "a", "pair": [0.0, 1.0], "inner": {"size": 1.0}}


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"kin": "a"}, "kin: expected one of inner, kind, many, other, pair"),
        ({"kind": "c"}, "kind: expected a or b, got 'c'"),
        ({"pair": [1]}, "pair: expected"),
        ({"inner": {"sise": 1}}, r"inner\.sise: expected one of size"),
        ({"inner": {"size": "big"}}, r"inner\.size: expected float, got 'big'"),
        ({"inner": {"size": -1}}, "size: expected 0 or more"),
        ({"inner": 3}, "inner: expected a table, got 3"),
    ],
)
def test_what_does_not_fit_is_one_line_with_its_place(values, says):
    with pytest.raises(InputError, match=says):
        from_plain(Outer, values)
