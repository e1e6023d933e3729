"""Checks of input values, and read-only copies of arrays."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, field, fields, is_dataclass, replace
from difflib import get_close_matches
from functools import wraps
from inspect import isfunction, signature
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Literal, ParamSpec, Self, TypeVar, cast, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from midair.errors import InputError, NonFiniteError, ShapeError, did_you_mean
from midair.progress import Progress
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
    ("OpenedTake", "Recording"): "midair.open_take reads a file with its calibration",
    ("OpenedTake", "Solution"): "play it first: midair.play(solution, rig)",
    ("OpenedTake", "str"): "call midair.open_take on the file",
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
"""Advice if a stage gets the result of another one, by (expected type, received type)."""


_LOOSE: dict[Any, tuple[type, ...]] = {bool: (bool, np.bool_), int: (Integral,), float: (Real,)}
_SPELLED: dict[Any, str] = {
    **{bool: "True or False", int: "a whole number", float: "a number", Progress: "a function"},
    **{str: "str", dict: "a dict", NoneType: "None"},
}


def check_type(value: object, name: str, *kinds: type) -> None:
    """Raise InputError that names both types, and the stage that is missing, if `value` is of none of these types."""
    if isinstance(value, tuple(each for kind in kinds for each in _LOOSE.get(kind, (kind,)))):
        return
    names = [_SPELLED.get(one, one.__name__) for one in kinds]
    got = "str" if hasattr(value, "__fspath__") else type(value).__name__
    advice = "give its name" if kinds[0] is str else f"see help({kinds[0].__module__.rpartition('.')[0]}.{names[0]})"
    advice = next((_STEPS[one, got] for one in reversed(names) if (one, got) in _STEPS), advice)
    came = repr(value) if kinds[0] in (bool, int, float, dict, Progress) else f"{type(value).__name__}; {advice}"
    raise InputError(f"{name}: expected {' or '.join(names)}, got {came}")


def checked_call(function: Callable[P, T]) -> Callable[P, T]:
    """The function or method, with one line for a call that does not fit its arguments.

    Arguments whose types are plain or dataclasses are checked too; a float alone is checked where its unit is known.
    """
    code, kinds = function.__code__, dict[str, tuple[type, ...]]()
    for name, kind in function.__annotations__.items():
        each = [get_origin(one) or one for one in (get_args(kind) if isinstance(kind, UnionType) else [kind])]
        plain = all(one in _SPELLED or is_dataclass(one) or hasattr(one, "__fspath__") for one in each)
        if plain and not {*each} <= {float, NoneType}:
            kinds[name] = tuple(each)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> T:
        for name, value in (*zip(code.co_varnames, args[: code.co_argcount], strict=False), *kwargs.items()):
            if name in kinds:
                check_type(value, name, *kinds[name])
        try:
            return function(*args, **kwargs)
        except TypeError as wrong:
            # An error of the call itself has no frame of the function.
            if wrong.__traceback__ is None or wrong.__traceback__.tb_next is not None:
                raise
            raise InputError(_misfit(function, args, kwargs) or str(wrong)) from None

    return checked


def check_calls(kind: T) -> T:
    """Give the constructor and the public methods of a class `checked_call`."""
    for name, made in list(vars(kind).items()):
        if isinstance(made, classmethod):
            setattr(kind, name, classmethod(checked_call(cast("Any", made).__func__)))
        elif isfunction(made) and (name == "__init__" or not name.startswith("_")):
            setattr(kind, name, checked_call(made))
    return kind


def _misfit(function: Callable[..., Any], args: Sequence[object], kwargs: Mapping[str, object]) -> str:
    """Why a call does not fit the arguments of a function; empty if another reason remains."""
    called, every = function.__qualname__.removesuffix(".__init__"), list(signature(function).parameters.values())
    owners = sum(one.name in ("self", "cls") for one in every[:1])
    known = {one.name: one for one in every[owners:] if one.kind is not one.VAR_KEYWORD}
    shown = {name: name + "=" * (one.kind is one.KEYWORD_ONLY) for name, one in known.items()}
    if len(shown) + owners == len(every):
        check_names(kwargs, shown, f"no argument of {called}")
    first = list(shown.values())[: len(args) - owners]
    if any("=" in name for name in first):
        return f"{called}: expected arguments with their names, such as {called}({', '.join(first)})"
    needed = [name for name, one in known.items() if one.default is one.empty]
    missing = " and no ".join(name for name in needed if name not in kwargs and name not in first)
    return f"{called}: expected {called}({', '.join(shown[name] for name in needed)}), got no {missing}" * bool(missing)


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


def check_names(given: Iterable[str], known: Iterable[str], what: str = "no setting") -> None:
    """Raise InputError for the first name that is not known, with the nearest one that is."""
    names = list(known)
    for name in given:
        if name not in names:
            near = get_close_matches(name, names, 1)
            advice = f"did you mean {near[0]}?" if near else f"expected one of {', '.join(names)}"
            raise InputError(f"{what} is named {name!r}; {advice}")


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
    """Raise InputError for the first setting outside its limits, which None is not, or none of its names."""
    for one in fields(settings):
        limits, value = one.metadata.get("limits"), getattr(settings, one.name)
        if get_origin(one.type) is Literal:
            one_of(value, one.type, one.name)
        # An infinite upper limit allows infinity.
        if limits is not None and value is not None and value != limits[1]:
            known = one.metadata
            within(value, one.name, *limits, unit=known["unit"], above=known["above"], setting=one.name)


def documented(kind: type[T]) -> type[T]:
    """Append the help texts of the settings of a dataclass to its docstring, and check calls of it."""
    indent = "\n" + 8 * " "
    helps = {one.name: one.metadata["help"] for one in fields(cast("Any", kind)) if one.metadata}
    rows = [f"    {name}{indent}{text.replace(chr(10), indent)}" for name, text in helps.items()]
    kind.__doc__ = "\n".join([f"{kind.__doc__}\n\n    Parameters\n    ----------", *rows])
    return check_calls(kind)


def _axes(axes: Sequence[str | int]) -> str:
    return "(" + ", ".join(str(axis) for axis in axes) + ")"
