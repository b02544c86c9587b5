"""Checks of numbers, names and arrays, with one style of message: `name = value: expected ...`.

`RANGES` holds the range of each number of a scene, a shot, an environment or a picture, and of seeds. The ranges are
much wider than the values on real tables. Within them the engines' arithmetic does not overflow and every shot ends: a
PIC shot after at most `max_events` events, a PIT shot also after at most `pit.MAX_STEPS` timesteps.
"""

from __future__ import annotations

import ast
import dataclasses
import difflib
import importlib
import inspect
import math
import re
import sys
import textwrap
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from numbers import Real
from types import MappingProxyType, UnionType
from typing import Any, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

T = TypeVar("T")

MAX_SPEED, MAX_SPIN = 1e3, 1e6
"""m/s and rad/s. The largest component of a velocity and of a spin."""


class Range(NamedTuple):
    """The range of a number.

    Attributes:
        least: The smallest value.
        most: The largest value; None for a whole number without an upper bound.
        unit: The unit, or other text that follows the bounds in an error message.
        reason: The reason for the bounds.
    """

    least: float
    most: float | None
    unit: str = ""
    reason: str = ""


RANGES: dict[str, Range] = {
    # A scene
    "length": Range(1e-4, 1e4, "m", "radii and tables; up to 10 km, coordinates are rounded by less than CONTACT_GAP"),
    "cushion_height": Range(1e-6, 1e4, "m", "as length; the nose may be below the centre of the smallest ball"),
    "coordinate": Range(-1e6, 1e6, "m", "of a pocket or of a cue ball in hand; far beyond any table"),
    "tip_radius": Range(0.0, 1e4, "m", "as length; 0 for a sharp corner"),
    "mass": Range(1e-8, 1e8, "kg, or inf", "the ratio of two masses is at most 1e16, the resolution of a double"),
    "g": Range(1e-3, 1e3, "m/s^2", "1e-3 on a small asteroid, 274 on the Sun"),
    "friction": Range(1e-12, 100.0, "", "from almost frictionless cloth to far more than rubber (about 1)"),
    "mu_cushion": Range(0.0, 100.0, "", "as friction, but a cushion may be frictionless"),
    "spin_decay": Range(1e-6, 1e6, "rad/s^2", "5 to 15 on cloth"),
    "mu_ball": Range(0.0, 100.0, "", "as mu_cushion; also its multiplier"),
    "frequency_ratio": Range(1.0, 2.0, "", "of a compliant body; 1.7 to 1.8 for a cushion"),
    "speed_loss": Range(0.0, 100.0, "s/m", "0 for no loss; about 0.1 for a cushion"),
    "onset": Range(0.0, MAX_SPEED, "m/s", "as speed"),
    "restitution": Range(0.0, 1.0, "", "an impact does not add energy"),
    "least_hop": Range(1e-12, 1e-4, "m", "a ball that hops lower is on the cloth"),
    "miscue_offset": Range(1e-3, 1.0, "ball radii", "1 at the edge of the ball; 0.5 to 0.55 with chalk"),
    "max_time": Range(1e-9, 1e12, "s", "up to 30,000 years; above 0, so the shot advances"),
    "balls": Range(1, 100_000, "", "a gigabyte of memory for two seconds of their events"),
    # A shot
    "speed": Range(-MAX_SPEED, MAX_SPEED, "m/s", "each component; the hardest breaks reach 16 m/s"),
    "heading": Range(-10.0, 10.0, "rad", "more than a full turn both ways"),
    "tip_offset": Range(-1.0, 1.0, "ball radii", "1 at the edge of the ball"),
    "elevation": Range(0.0, np.pi / 2, "rad", "from a level to a vertical cue"),
    "spin": Range(-MAX_SPIN, MAX_SPIN, "rad/s", "each component; a ball that rolls at 16 m/s has 600 rad/s"),
    "limit": Range(0.0, 1e12, "s", "as max_time, but a shot may end at its start"),
    "dt": Range(1e-9, 1e6, "s", "a micrometre of motion at 1000 m/s; no shot takes 1e6 s"),
    "max_events": Range(0, 1_000_000_000, "", "minutes of computing with two balls; a break has hundreds of events"),
    "threads": Range(1, 1024, "", "more than the cores of one machine"),
    # An environment
    "max_speed": Range(1e-6, MAX_SPEED, "m/s", "as speed"),
    "max_shots": Range(1, 1_000_000_000, "", "the counters hold it"),
    "num_envs": Range(1, 10_000_000, "", "gigabytes of memory"),
    "scratch_penalty": Range(0.0, 1e6, "", "a shot scores only a few points"),
    "angle_std": Range(0.0, 360.0, "degrees", "up to a full turn"),
    "speed_std": Range(0.0, MAX_SPEED, "m/s", "as speed"),
    "offset_std": Range(0.0, 1.0, "m", "far more than a ball"),
    "elevation_std": Range(0.0, 360.0, "degrees", "as angle_std"),
    "scatter_std": Range(0.0, 0.25, "", "a share; above 0.28 a ball could leave a cushion into it"),
    # A picture
    "frame_width": Range(160, 7680, "pixels", "from the smallest readable picture to 8K"),
    "fps": Range(1e-3, 1e3, "frames per second", "more than any screen shows"),
    # Random numbers
    "seed": Range(0, None, "", "the seeds of numpy.random.SeedSequence"),
}
"""The range of each number and the reason for its bounds."""

NO_RANGES: Mapping[str, Range] = MappingProxyType({})
"""The ranges of entries without numbers."""


def short(value: Any, digits: int = 12) -> str:
    """Returns `repr(value)` in one line, cut to 200 characters. NumPy scalars look like numbers of Python.

    Numbers have at most `digits` digits; 17 for all.

    Example:
        >>> short([0.1 + 0.7, 1e-5, 10]), short(0.1 + 0.7, 17)
        ('[0.8, 1e-05, 10]', '0.7999999999999999')
    """
    try:
        with np.printoptions(**_PLAIN_SCALARS):
            text = " ".join(repr(value).split("\n"))
    except (ValueError, RecursionError):  # a number of thousands of digits, deeply nested lists
        text = f"a {type(value).__name__}"
    if not isinstance(value, str):
        text = _LONG.sub(lambda match: repr(float(f"{float(match[0]):.{digits}g}")), text)
    return text if len(text) <= 200 else text[:200] + "..."


def fits(value: Any, within: str | Range) -> bool:
    """Returns whether `value` is a real number in a range.

    Args:
        value: Anything.
        within: The range, or its key in `RANGES`.
    """
    if not isinstance(value, (int, float)):
        if not isinstance(value, (np.integer, np.floating)) or isinstance(value, np.timedelta64):
            return False
        value = value.item()  # a numpy integer of few bits cannot be compared with a large bound
    elif isinstance(value, bool):
        return False
    least, most, _, _ = RANGES[within] if isinstance(within, str) else within
    return least <= value and (most is None or value <= most)  # False for a NaN


def real(name: str, value: Any, within: str | Range | None = None) -> float:
    """Returns a real number as a float, after a check of its type and range.

    Args:
        name: Name used in error messages.
        value: The number; a bool or a string is not a number.
        within: The range, or its key in `RANGES`; None for any finite number.

    Returns:
        The number as a float.

    Raises:
        TypeError: If `value` is not a number.
        ValueError: If it is outside the range or not finite.

    Example:
        >>> real("table.length", 2)
        2.0
        >>> real("table.length", -2, "length")
        Traceback (most recent call last):
        ValueError: table.length = -2: expected a number from 0.0001 to 10000 m
    """
    if isinstance(value, (bool, np.timedelta64)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{name} = {short(value)}: expected a number, not {type(value).__name__}")
    if not fits(value, _FINITE if within is None else within):
        expected = "a finite number" if within is None else range_text("a number", within)
        digits = 17 if fits(number(short(value)), within or _FINITE) else 12  # all digits of 1.0000000000000002
        raise ValueError(f"{name} = {short(value, digits)}: expected {expected}")
    return float(value)


def integer(name: str, value: Any, within: str | Range) -> int:
    """Returns a whole number as an int, after a check of its type and range.

    Args:
        name: Name used in error messages.
        value: The number.
        within: The range, or its key in `RANGES`.

    Returns:
        The number as an int.

    Raises:
        ValueError: If `value` is not a whole number or is outside the range.

    Example:
        >>> integer("max_shots", 0, "max_shots")
        Traceback (most recent call last):
        ValueError: max_shots = 0: expected a whole number from 1 to 1000000000
    """
    least, most, _, _ = RANGES[within] if isinstance(within, str) else within
    is_integer = isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.timedelta64))
    if not is_integer or value < least or (most is not None and value > most):
        raise ValueError(f"{name} = {short(value)}: expected {range_text('a whole number', within)}")
    return int(value)


def range_text(what: str, within: str | Range) -> str:
    """Returns what an error message expects: the numbers of a range, or its only number.

    Example:
        >>> range_text("a number", "dt")
        'a number from 1e-09 to 1e+06 s'
    """
    least, most, unit, _ = RANGES[within] if isinstance(within, str) else within
    if least == most:
        text = _text(least)
    else:
        text = f"{what} " + (f">= {_text(least)}" if most is None else f"from {_text(least)} to {_text(most)}")
    return text + (unit if unit.startswith(",") or not unit else f" {unit}")


def number(value: Any) -> Any:
    """Converts a text such as "1e6" or "1/60" to a number, and returns any other value unchanged.

    YAML and the command line give these numbers as text.

    Example:
        >>> number("1/4"), number("1e6"), number("pool")
        (0.25, 1000000.0, 'pool')
    """
    if not isinstance(value, str):
        return value
    match = re.fullmatch(rf"({_NUMBER})(?:/({_NUMBER}))?", re.sub(r"\s|(?<=\d)_(?=\d)", "", value))
    if match is None or (match[2] is not None and float(match[2]) == 0):
        return value
    return float(match[1]) / float(match[2] or 1)


def one_of(name: str, value: Any, choices: tuple[str, ...]) -> None:
    """Checks that `value` is one of `choices`; raises a ValueError that suggests the closest one.

    Example:
        >>> one_of("mode", "pci", ("pic", "pit"))
        Traceback (most recent call last):
        ValueError: mode = 'pci': expected one of 'pic', 'pit' (did you mean 'pic'?)
    """
    if not isinstance(value, str) or value not in choices:
        raise ValueError(
            f"{name} = {short(value)}: expected one of {', '.join(map(repr, choices))}{suggestion(str(value), choices)}"
        )


def key_of(what: str, value: Any, table: Mapping[str, Any]) -> str:
    """Returns the key of an entry of a table, such as `TASKS`, from its name.

    Args:
        what: The name used in error messages.
        value: The key, or "module:key". The module is imported first; it may add the entry with `add_entry`.
        table: The entries by key.

    Raises:
        ValueError: If there is no such entry, or the module cannot be imported.

    Example:
        >>> key_of("task", "billiards_env.envs:pot", {"pot": 1}), key_of("task", "pot", {"pot": 1})
        ('pot', 'pot')
    """
    import_module_of(what, value)
    module, colon, key = value.rpartition(":") if isinstance(value, str) else ("", "", value)
    if not colon:
        one_of(what, key, tuple(table))
    elif key not in table:
        expected = f"a name that {module!r} registers{suggestion(key, tuple(table))}"
        raise ValueError(f"{what} = {short(value)}: expected {expected}")
    return key


def import_module_of(what: str, value: Any) -> None:
    """Imports the module of a name "module:key"; the arguments and errors are those of `key_of`."""
    if isinstance(value, str) and ":" in value:
        try:
            importlib.import_module(value.rpartition(":")[0])
        except (Exception, SystemExit) as error:  # the code of the module may raise any
            why = f"{type(error).__name__}: {error}"
            raise ValueError(f"{what} = {short(value)}: expected a module that can be imported ({why})") from error


def entry_of(what: str, value: Any, table: Mapping[str, T]) -> T:
    """Returns an entry of a table from its name; the arguments and errors are those of `key_of`."""
    return table[key_of(what, value, table)]


def short_name(name: str) -> str:
    """Returns the key of an entry from its name, "key" or "module:key"."""
    return name.rpartition(":")[2]


def add_entry(
    what: str,
    name: str,
    entry: T,
    table: MutableMapping[str, T],
    kind: type,
    ranges: Mapping[str, Range] = NO_RANGES,
    **takes: int,
) -> None:
    """Adds an entry of another package to a table, such as `TASKS`.

    The same entry may be added again. Another package may also change its own entry, for example in a cell of a
    notebook. An entry is its own if a function of the old entry and one of the new entry are from the same module.

    Args:
        what: What the table holds, for error messages.
        name: The name of the entry, an identifier of ASCII letters, digits and underscores.
        entry: The entry.
        table: The entries by name.
        kind: The type of the entries. The attributes of the entry must have its annotated types.
        ranges: The range of the numbers of an attribute. A smallest and a largest number are a tuple of two.
        **takes: The number of arguments of each function of the entry, by its attribute.

    Raises:
        TypeError: If the entry or an attribute has another type, or a function does not take its arguments.
        ValueError: If a number is outside its range, the name is not an identifier, or another entry has it.
    """
    if not (isinstance(name, str) and name.isascii() and name.isidentifier()):
        raise ValueError(f"name = {short(name)}: expected ASCII letters, digits and underscores, such as 'my_{what}'")
    if not isinstance(entry, kind):
        raise TypeError(f"{what} = {short(entry)}: expected the type {kind.__name__}, not {type(entry).__name__}")
    for attribute, count in takes.items():
        function = getattr(entry, attribute)
        if function is not kind._field_defaults.get(attribute, entry):  # pyright: ignore[reportAttributeAccessIssue]
            check_call(f"{attribute} of {what} {name!r} = {short(function)}", function, count)
    for attribute, hint in get_type_hints(kind).items():
        value, shown = getattr(entry, attribute), f"{attribute} of {what} {name!r}"
        if not _has_type(value, hint):
            wanted = str(hint) if get_args(hint) else hint.__name__
            raise TypeError(f"{shown} = {short(value)}: expected the type {wanted}, not {type(value).__name__}")
        found = [one for one in (value if isinstance(value, tuple) else (value,)) if one is not None]
        if attribute in ranges and not all(fits(one, ranges[attribute]) for one in found):
            expected = range_text("numbers" if isinstance(value, tuple) else "a number", ranges[attribute])
            raise ValueError(f"{shown} = {short(value)}: expected {expected}")
        if attribute in ranges and get_origin(hint) is tuple and len(found) == 2 and found[0] > found[1]:
            raise ValueError(f"{shown} = {short(value)}: expected the smallest number first")
    old = table.get(name, entry)
    if _definition(old) != _definition(entry) and not _own_modules(old) & _own_modules(entry):
        raise ValueError(f"name = {name!r}: expected a name that no other {what} has")
    table[name] = entry


def _has_type(value: Any, hint: Any) -> bool:
    """Returns whether a value has an annotated type. An int is also a float, and a bool is no number."""
    kind, kinds = get_origin(hint) or hint, get_args(hint)
    if kind is tuple and isinstance(value, tuple):
        each = kinds[:1] * len(value) if kinds[-1] is ... else kinds
        return len(each) == len(value) and all(map(_has_type, value, each))
    if kind in (Union, UnionType):
        return any(_has_type(value, one) for one in kinds)
    if kind in (int, float):
        return isinstance(value, (int, kind)) and not isinstance(value, bool)
    return isinstance(value, kind)


def check_call(what: str, function: Any, count: int, expected: str = "") -> None:
    """Raises a TypeError unless a function takes `count` arguments.

    Args:
        what: The text "name = value".
        function: The function, or anything else.
        count: The number of arguments.
        expected: What is expected; by default a function with this number of arguments.
    """
    try:
        inspect.signature(getattr(function, "py_func", function)).bind(*range(count))
    except (TypeError, ValueError):  # a ValueError for a built-in function without a signature
        usual = f"a function with {count} argument{'s' * (count != 1)}"
        raise TypeError(f"{what}: expected {expected or usual}") from None


def check_attributes(what: str, function: Any, *names: tuple[str, ...]) -> None:
    """Checks which attributes of its arguments a function uses. Does nothing if its source code is not available.

    It does not check names that begin with "_", and names that the function assigns, which then are no arguments.

    Args:
        what: The name of the function, used in error messages.
        function: The function or kernel.
        *names: For each argument the names of its attributes; () for an argument that is not checked.

    Raises:
        ValueError: If the function uses another attribute of an argument.
    """
    function = getattr(function, "py_func", function)
    try:
        known = dict(zip(inspect.signature(function).parameters, names, strict=False))
        (code,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    except (OSError, TypeError, ValueError, SyntaxError):  # ValueError and TypeError for built-in functions
        return
    if not isinstance(code, ast.FunctionDef):  # the statement around a lambda
        return
    nodes = [node for statement in code.body for node in ast.walk(statement)]
    for node in nodes:
        if isinstance(node, ast.arg) or (isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load)):
            known.pop(node.arg if isinstance(node, ast.arg) else node.id, None)
    read = [node for node in nodes if isinstance(node, ast.Attribute) and node.attr[0] != "_"]
    for node in read:
        if isinstance(node.value, ast.Name) and (fields := known.get(node.value.id)):
            one_of(f"attribute of {node.value.id!r} in {what}", node.attr, fields)


def result_of(name: str, kind: Any, function: Callable[..., Any], *arguments: Any) -> Any:
    """Returns the result of a function of another package. Errors of the function pass unchanged.

    Args:
        name: The name of the result, used in error messages.
        kind: The type of the result; `object` for any.
        function: The function.
        *arguments: Its arguments.

    Raises:
        TypeError: If the result has another type.
        ValueError: If the function ends the process.

    Example:
        >>> result_of("scene 'mine'", dict, list)
        Traceback (most recent call last):
        TypeError: scene 'mine' = []: expected the type dict, not list
    """
    try:
        result = function(*arguments)
    except SystemExit as error:
        raise ValueError(f"{name} = SystemExit({error}): expected a result") from error
    if not isinstance(result, kind):
        raise TypeError(f"{name} = {short(result)}: expected the type {kind.__name__}, not {type(result).__name__}")
    return result


def is_foreign(function: Any) -> bool:
    """Returns whether another package defines a function or kernel, so that its results are checked."""
    return str(getattr(function, "__module__", "")).partition(".")[0] != __name__.partition(".")[0]


def _definition(entry: Any) -> Any:
    """Returns what stays the same if a module is loaded again: the values of an entry, and its functions by name.

    Functions with the same name and code in one module, such as two equal lambdas, count as the same.
    """
    if isinstance(entry, tuple):
        return tuple(map(_definition, entry))
    if isinstance(entry, Mapping):
        return {key: _definition(value) for key, value in entry.items()}
    code = getattr(getattr(entry, "py_func", entry), "__code__", None)
    return (entry.__module__, entry.__qualname__, code and code.co_code) if hasattr(entry, "__qualname__") else entry


def _own_modules(entry: Any) -> set[str]:
    """Returns the modules of other packages in which the functions of an entry are defined."""
    if isinstance(entry, tuple):
        return set[str]().union(*map(_own_modules, entry))
    module = entry.__module__ if hasattr(entry, "__qualname__") else "billiards_env"
    return set() if module.partition(".")[0] in ("billiards_env", "builtins") else {module}


def suggestion(name: str, choices: Sequence[str]) -> str:
    """Returns the end of a message that suggests the choice most like a name; "" if none is like it.

    The case and the order of the letters do not count.
    """
    lower = {choice.lower(): choice for choice in choices}
    same_letters = [choice for choice in lower if sorted(choice) == sorted(name.lower())]
    close = same_letters or difflib.get_close_matches(name.lower(), lower, 1)
    return f" (did you mean {lower[close[0]]!r}?)" if close else ""


def flag(name: str, value: Any) -> bool:
    """Returns a bool or a NumPy bool as a bool. Raises a ValueError for any other value."""
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{name} = {short(value)}: expected True or False")
    return bool(value)


def _is_masked(value: Any) -> bool:
    if isinstance(value, (list, tuple)):  # NumPy replaces masked numbers in a list by NaN, which other checks refuse
        return bool(value) and not isinstance(value[0], (float, int)) and any(map(_is_masked, value))
    return is_masked_array(value) and bool(np.any(value.mask))


def is_masked_array(value: Any) -> bool:
    """Returns whether a value is a masked array. There are none before NumPy's slow import of `numpy.ma`."""
    module: Any = sys.modules.get("numpy.ma")
    return module is not None and isinstance(value, module.MaskedArray)


def array_of(name: str, value: Any, expected: str = "an array, or lists of one length") -> NDArray[Any]:
    """Returns a copy of an array or of lists. Raises a ValueError for masked values and lists of several lengths."""
    if _is_masked(value):  # NumPy would ignore the mask
        raise ValueError(f"{name} = {short(value)}: expected no masked values")
    try:
        return np.array(value)
    except (OverflowError, TypeError, ValueError):
        raise ValueError(f"{name} = {short(value)}: expected {expected}") from None


def numbers(name: str, value: ArrayLike | None) -> NDArray[np.float64]:
    """Returns a float64 copy of an array or of lists of real numbers. Raises a ValueError for other values.

    The copy has the layout "C", which the entry points of `jit.Typed` do not check.
    """
    expected = "finite numbers in an array"
    array = array_of(name, value, expected)
    try:
        # NumPy would also convert complex numbers, without their imaginary parts, texts, times and bools.
        if array.dtype.kind in "iuf" or (array.dtype == object and all(map(_is_real, array.flat))):
            return array.astype(np.float64, order="C", copy=False)
    except (OverflowError, TypeError, ValueError):  # a number beyond float64
        pass
    raise ValueError(f"{name} = {short(value)}: expected {expected}")


def _is_real(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, (bool, np.timedelta64))


def shaped(name: str, value: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Returns a float64 copy of an array. Raises a ValueError unless it holds numbers and has the shape `shape`."""
    if type(value) is np.ndarray and value.shape == shape and value.dtype.kind == "f":  # faster
        return value.astype(np.float64, "C")
    array = numbers(name, value)
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}: expected {shape}")
    return array


def finite(name: str, value: ArrayLike | None, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Returns a copy of an array as float64, after a check of its shape and of its numbers.

    Raises:
        ValueError: If the array does not have the shape `shape`, or a number is not finite.

    Example:
        >>> finite("action", [0.5, float("nan")], (2,))
        Traceback (most recent call last):
        ValueError: action = [0.5, nan]: expected finite numbers
    """
    array = shaped(name, value, shape)
    short_array = array.ndim == 1 and len(array) < 16  # Python checks these faster than NumPy
    if not ((short_array and math.isfinite(sum(array.tolist()))) or np.isfinite(array).all()):
        raise ValueError(f"{name} = {short(array.tolist())}: expected finite numbers")
    return array


def check_fields(owner: object, prefix: str, **ranges: str) -> None:
    """Checks the fields of a frozen dataclass against their ranges and converts them to floats."""
    for name, within in ranges.items():
        object.__setattr__(owner, name, real(f"{prefix}.{name}", getattr(owner, name), within))


def check_version(name: str, value: Any, own: int) -> None:
    """Raises a ValueError unless data have the version `own` of their form."""
    if type(value) is not int or value != own:
        raise ValueError(f"{name} = {short(value)}: expected {own}; another version of billiards_env wrote the data")


def sequence(name: str, values: Any) -> tuple[Any, ...]:
    """Returns a list as a tuple. Raises a TypeError for a value that is not a list or a tuple."""
    if not isinstance(values, (list, tuple)):
        raise TypeError(f"{name} = {short(values)}: expected a list")
    return tuple(values)


def fields_of(kind: type, name: str, data: Any, complete: bool = False) -> dict[str, Any]:
    """Returns `data` as keyword arguments of the dataclass `kind`.

    Raises an error if a key is unknown or missing; with `complete` a key with a default may not be missing either.
    """
    if not isinstance(data, Mapping):
        raise TypeError(f"{name} = {short(data)}: expected a mapping")
    fields = {f.name: f for f in dataclasses.fields(kind)}
    for key in data:
        one_of(f"key of {name}", key, tuple(fields))
    for key, field in fields.items():
        if key not in data and field.default is field.default_factory:  # both are missing
            raise ValueError(f"{name}.{key} is missing: expected a value, it has no default")
        if key not in data and complete:
            raise ValueError(
                f"{name}.{key} is missing: expected all values in a whole scene; changes of a named scene need the key "
                '"base", such as {"base": "pool", "physics": {"mu_roll": 0.012}}'
            )
    return dict(data)


def missing(module: str, extra: str) -> ModuleNotFoundError:
    """Returns the error for a module that is not installed, with the commands that install its extra."""
    return ModuleNotFoundError(
        f"{module} is not installed: expected the extra {extra!r}: pip install 'billiards-env[{extra}]' "
        f"(in a clone: pip install '.[{extra}]')",
        name=module,
    )


# From NumPy 2 on, repr(np.float64(1.0)) is "np.float64(1.0)" by default.
_PLAIN_SCALARS: dict[str, Any] = {"legacy": "1.25"} if np.lib.NumpyVersion(np.__version__) >= "2.0.0" else {}
_NUMBER = r"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|inf|nan)"
_LONG = re.compile(r"-?\b\d+\.\d{9,}(?:e[-+]\d+)?\b")
_FINITE = Range(-sys.float_info.max, sys.float_info.max)


def _text(bound: float) -> str:
    return str(bound) if isinstance(bound, int) else f"{bound:g}"
