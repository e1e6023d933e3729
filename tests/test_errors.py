import inspect
import pickle

from midair import errors
from midair.errors import MidairError

LEAVES = [one for _, one in inspect.getmembers(errors, inspect.isclass) if one.__module__ == errors.__name__]


def test_every_error_is_a_midair_error_with_its_message():
    assert [
        one for one in LEAVES if not issubclass(one, MidairError) or str(one("expected this")) != "expected this"
    ] == []


def test_an_input_error_names_parameters_as_they_are_typed_in_python_or_elsewhere():
    error = pickle.loads(
        pickle.dumps(errors.RateError("a {b}.csv: no rate", parameters={"rate": "rate=2", "unit": "unit=3"}))
    )
    assert str(error) == "a {b}.csv: no rate; give rate=2, or unit=3"
    assert error.message({"rate": "--rate 2Hz"}) == "a {b}.csv: no rate; give --rate 2Hz, or unit=3"
