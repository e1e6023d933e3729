"""Checks of input values, and read-only copies of arrays."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, field, fields, replace
from difflib import get_close_matches
from functools import wraps
from inspect import signature
from typing import Any, ParamSpec, Self, TypeVar, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from midair.errors import InputError, NonFiniteError, ShapeError, did_you_mean
from midair.streaming import LazyFrames

T = TypeVar("T")
P = ParamSpec("P")


def frozen_array(
    value: "ArrayLike | LazyFrames",
    name: str,
    axes: Sequence[str | int],
    dtype: DTypeLike = np.float64,
    *,
    finite: bool = True,
) -> NDArray[Any]:
    """A read-only copy of `value` whose axes and numbers have been checked; lazy frames are checked when read.

    Each entry of `axes` is an axis: a word for any length from 1 on, a number for a fixed length. Raises ShapeError or
    NonFiniteError.
    """
    if isinstance(value, LazyFrames):
        _check_shape(value.shape, name, axes)
        # Type checkers treat lazy frames as an array.
        return cast("NDArray[Any]", value)
    if hasattr(value, "dtype") and np.iscomplexobj(value) and not np.issubdtype(dtype, np.complexfloating):
        raise InputError(f"{name}: expected real numbers, got complex ones; np.abs gives their magnitudes")
    try:
        if (given := np.asarray(value)).dtype.kind in "SU":
            raise TypeError("text")
        array = np.array(given, dtype=dtype, order="C")
    except (TypeError, ValueError) as wrong:
        raise ShapeError(f"{name}: expected numbers with axes {_axes(axes)}, got {type(value).__name__}") from wrong
    _check_shape(array.shape, name, axes)
    if finite:
        check_finite(array, name)
    array.flags.writeable = False
    return array


def is_number(text: str) -> bool:
    """True for text that Python reads as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def check_finite(array: NDArray[Any], name: str, *, frame: int = 0) -> None:
    """Raise NonFiniteError if a number is NaN or infinite; `frame` is the number of the array's first frame."""
    if not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        place = (first[0] + frame, *first[1:]) if first else first
        raise NonFiniteError(
            f"{name}: expected finite numbers, got {array[first]} at {place}; midair import --mend fills short gaps"
        )


def _check_shape(shape: tuple[int, ...], name: str, axes: Sequence[str | int]) -> None:
    fits = len(shape) == len(axes) and all(
        have == want if isinstance(want, int) else have > 0 for have, want in zip(shape, axes, strict=True)
    )
    if not fits:
        raise ShapeError(f"{name}: expected axes {_axes(axes)}, got shape {shape}")


_STEPS = {
    ("PressureFrames", "Recording"): "call calibrate first",
    ("PressureFrames", "OpenedTake"): "call calibrate(take.recording, take.calibration) first",
    ("Recording", "OpenedTake"): "use its .recording",
    ("AmplitudeFrames", "PressureFrames"): "call prepare first",
    ("AmplitudeFrames", "Recording"): "call calibrate and prepare first",
    ("Drive", "AmplitudeFrames"): "call solve first",
    ("Drive", "PressureFrames"): "call prepare and solve first",
    ("PressureFrames", "AmplitudeFrames"): "use the pressure that it was prepared from",
    ("PressureFrames", "str"): "call midair.open_take on the file and calibrate first",
    ("Recording", "str"): "call midair.open_take on the file and use its .recording",
    ("Calibration", "str"): "call midair.load_calibration on the file",
    ("Drive", "str"): "call midair.load on the file",
    ("TransducerArray", "str"): "call midair.TransducerArray.autd3()",
}
"""What to do if a stage gets the result of another one: (expected type, received type)."""


def check_type(value: object, name: str, *kinds: type) -> None:
    """Raise InputError that names both types, and the stage that is missing, if `value` is of none of these types."""
    if isinstance(value, kinds):
        return
    names = ["None" if one is type(None) else one.__name__ for one in kinds]
    got = "str" if hasattr(value, "__fspath__") else type(value).__name__
    advice = "give its name" if names[0] == "str" else f"see help(midair.{names[0]})"
    advice = _STEPS.get((names[0], got), advice)
    raise InputError(f"{name}: expected {' or '.join(names)}, got {type(value).__name__}; {advice}")


def by_name(function: Callable[P, T]) -> Callable[P, T]:
    """The method, whose arguments have to be named, with one line for those who do not name them."""

    @wraps(function)
    def named(*args: P.args, **kwargs: P.kwargs) -> T:
        if len(args) > 1:
            kind = args[0] if isinstance(args[0], type) else type(args[0])
            made = kind.__name__ if function.__name__ == "__init__" else f"{kind.__name__}.{function.__name__}"
            names = ", ".join(f"{name}=" for name in list(signature(function).parameters)[1 : len(args)])
            raise InputError(f"{made}: expected arguments with their names, such as {made}({names})")
        return function(*args, **kwargs)

    return named


def positive(value: float, name: str, unit: str = "") -> float:
    """Return `value` as a float if it is finite and above zero; otherwise raise InputError."""
    given = number(value, name, unit)
    if not (np.isfinite(given) and given > 0):
        raise InputError(f"{name}: expected a number above 0{' ' + unit if unit else ''}, got {given:g}")
    return given


PITCHES = (1e-6, 0.2)
"""Allowed distances between grid points, in m."""


def number(value: object, name: str, unit: str = "", *, setting: str = "") -> float:
    """Return `value` as a float if it is a number; raise InputError for text and other types."""
    if isinstance(value, str) or not hasattr(value, "__float__"):
        raise InputError(f"{name}: expected a number{unit and f' in {unit}'}, got {value!r}", setting=setting)
    return float(cast("float", value))


def within(
    value: object,
    name: str,
    low: float,
    high: float = np.inf,
    *,
    unit: str = "",
    above: bool = False,
    advice: str = "",
    setting: str = "",
) -> float:
    """Return `value` as a float if it is finite and from `low`, or `above` it, to `high`; InputError otherwise."""
    given = number(value, name, unit, setting=setting)
    if np.isfinite(given) and (low < given <= high or (given == low and not above)):
        return given
    factor, shown = (1e3, " ms") if unit == "s" and high < 1 else (1.0, f" {unit}".rstrip())
    least, most = f"{factor * low:g}", f"{factor * high:g}{shown}"
    if above:
        asked = f"above {least}{shown}" if np.isinf(high) else f"above {least} and at most {most}"
    else:
        asked = f"{least}{shown} or more" if np.isinf(high) else f"{least} to {most}"
    if unit == "m" and low <= given / 1e3 <= high:
        advice = f"lengths are in metres, {given:g} mm is {given / 1e3:g}"
    hint = f"; {advice}" if advice else ""
    raise InputError(f"{name}: expected {asked}, got {factor * given:g}{shown}{hint}", setting=setting)


def length(value: float, name: str, limits: tuple[float, float]) -> float:
    """Return `value` as a float if it is within the limits, in m; otherwise raise InputError."""
    return within(value, name, *limits, unit="m")


def one_of(value: object, known: Any, name: str, *, error: type[InputError] = InputError) -> None:
    """Raise an error unless `value` is one of `known`: the values of a Literal, or names."""
    names = get_args(known) or tuple(known)
    if value not in names:
        raise error(f"{name}: expected one of {', '.join(names)}, got {value!r}{did_you_mean(str(value), names)}")


def check_names(given: Iterable[str], known: Iterable[str]) -> None:
    """Raise InputError for the first name that no setting has, with the nearest one that there is."""
    names = list(known)
    for name in given:
        if name not in names:
            near = get_close_matches(name, names, 1)
            advice = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(names)}"
            raise InputError(f"no setting is named {name!r}; {advice}")


def setting(
    default: Any,
    about: str,
    *,
    unit: str = "",
    limits: tuple[float, float] | None = None,
    above: bool = False,
    compare: bool = True,
    **more: Any,
) -> Any:
    """Declare a setting: a field of a dataclass with its help text, SI unit and limits; `above` excludes the lower one.

    Values of the dataclass are equal without regard to a setting that is not to `compare`. A callable as `default`
    makes the default. Options, request models and provenance derive from the declaration; `more` is metadata for them.
    """
    known = {"help": about, "unit": unit, "limits": limits, "above": above, **more}
    made: Any = {"default_factory" if callable(default) else "default": default}
    return field(**made, compare=compare, metadata=known)


class Declared:
    """Base of a dataclass whose fields are declared by `setting`."""

    __slots__ = ()

    def but(self, **changes: Any) -> Self:
        """Return the settings with other values; None stands for the default, and a path for the file's content."""
        check_names(changes, [one.name for one in fields(cast("Any", self))])
        for one in fields(cast("Any", self)):
            value = changes.get(one.name, one)
            if value is None:
                changes[one.name] = one.default if one.default_factory is MISSING else one.default_factory()
            elif "load" in one.metadata and (isinstance(value, str) or hasattr(value, "__fspath__")):
                changes[one.name] = one.metadata["load"](value)
        return cast("Self", replace(cast("Any", self), **changes))


def check_settings(settings: Any) -> None:
    """Raise InputError for the first setting that is outside its limits; None is within all limits."""
    for one in fields(settings):
        limits, value = one.metadata.get("limits"), getattr(settings, one.name)
        if one.type in (str, "str"):
            check_type(value, one.name, str)
        # An infinite upper limit allows infinity.
        if limits is not None and value is not None and value != limits[1]:
            known = one.metadata
            within(value, one.name, *limits, unit=known["unit"], above=known["above"], setting=one.name)


def documented(kind: type[T]) -> type[T]:
    """Append the help texts of the settings of a dataclass to its docstring."""
    indent = "\n" + 8 * " "
    helps = {one.name: one.metadata["help"] for one in fields(cast("Any", kind)) if one.metadata}
    rows = [f"    {name}{indent}{text.replace(chr(10), indent)}" for name, text in helps.items()]
    kind.__doc__ = "\n".join([f"{kind.__doc__}\n\n    Parameters\n    ----------", *rows])
    return kind


def _axes(axes: Sequence[str | int]) -> str:
    return "(" + ", ".join(str(axis) for axis in axes) + ")"
