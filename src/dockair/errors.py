"""What a person can do wrong, said in one line: where, what was expected, what was got, what exists."""

import math
import sys
from collections.abc import Collection, Iterable, Sequence
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from numbers import Integral, Real
from typing import Any, cast, get_args, get_origin


class DockairError(Exception):
    """Wrong input. The command line prints its one line and exits with 2.

    Args:
        where: the file, key, option or argument at fault, as its user would write it.
        expected: what would have been right.
        got: what was there instead.
        exists: the allowed names, if there is a list of them; the one that is most like `got` is asked for.
        also: other places at fault, which would be refused next.

    With `where` alone, that is the whole line: this is how pickle and gymnasium's vector environments make again what
    another process has raised.
    """

    exit_code = 2

    def __init__(
        self,
        where: object,
        *,
        expected: str | None = None,
        got: object = None,
        exists: Iterable[str] = (),
        also: Iterable[str] = (),
    ) -> None:
        self.where, self.expected, self.got = str(where), expected or "", got
        self.exists, self.also = tuple(exists), tuple(also)
        text = self.where
        if expected is not None:
            text += f": expected {expected}, got {got!r}" if got is not None else f": expected {expected}"
        if self.exists:
            text += f"; exists: {', '.join(self.exists)}{_meant(got, self.exists)}"
        if self.also:
            text += f"; also wrong: {', '.join(self.also)}"
        super().__init__(text)

    def at(self, where: object) -> "DockairError":
        """Return the same, said of another place: one that the person at fault has written."""
        return DockairError(where, expected=self.expected or None, got=self.got, exists=self.exists, also=self.also)

    def __reduce__(self) -> tuple[type["DockairError"], tuple[str, ...]]:
        """Pickle the line alone: `got` may be anything, and what cannot be pickled would be lost without a word."""
        return type(self), (str(self),)


def _meant(got: object, exists: tuple[str, ...]) -> str:
    """Return the question for the name that exists and is nearest to a misspelt one, "" where none is near."""
    if not isinstance(got, str) or got in exists:
        return ""
    near = get_close_matches(got, exists, n=1)
    return f"; did you mean {near[0]}?" if near else ""


class MachineError(DockairError):
    """The machine lacks something (an OpenGL context, memory). The command line exits with 3."""

    exit_code = 3

    def __init__(self, where: object, *, expected: str | None = None, remedy: str = "") -> None:
        super().__init__(where, expected=expected)
        if remedy:
            self.args = (f"{self}; {remedy}",)


def check_integer(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Return a whole number, numpy's too, as an int; refuse what is none, or outside the limits."""
    is_whole = not isinstance(value, bool) and isinstance(value, Integral)
    if is_whole and int(value) >= least and (most is None or int(value) <= most):
        return int(value)
    limits = f"from {least} on" if most is None else f"from {least} to {most}"
    raise DockairError(name, expected=f"an integer {limits}", got=value)


def check_numbers(
    where: str,
    settings: Any,
    *,
    zero: Collection[str] = (),
    signed: Collection[str] = (),
    infinite: Collection[str] = (),
    below_one: Collection[str] = (),
) -> None:
    """Refuse a dataclass with a number in it that is not finite and above 0.

    Args:
        where: what the dataclass is called in its keys.
        settings: the dataclass; of its fields those of `int`, `float` and tuples of `float` are looked at, and whether
            those of another dataclass are one.
        zero: fields that may be 0, too.
        signed: fields that may be any finite number.
        infinite: fields that may be infinite, too.
        below_one: fields that have to be below 1, too: probabilities and shares.
    """
    for field in fields(settings):
        name, value, types = f"{where}.{field.name}", getattr(settings, field.name), get_args(field.type)
        is_vector = get_origin(field.type) is tuple and types[0] is float
        if is_dataclass(field.type) and not isinstance(value, cast(type, field.type)):
            raise DockairError(name, expected=cast(type, field.type).__name__, got=value)
        if field.type is int:
            check_integer(name, value, 0 if field.name in zero else 1)
        elif field.type is float or is_vector:
            numbers = _parts(name, value, types) if is_vector else (value,)
            least, text = (-math.inf, "") if field.name in signed else (0.0, " above 0")
            if field.name in zero:
                least, text = math.nextafter(0.0, -1.0), " from 0 on"
            most, kind = (math.inf, "number") if field.name in infinite else (sys.float_info.max, "finite number")
            if field.name in below_one:
                most, kind, text = math.nextafter(1.0, 0.0), "number", f"{text}, below 1"
            if not all(_is_number(one) and least < float(one) <= most for one in numbers):
                raise DockairError(name, expected=f"{kind}s{text}" if is_vector else f"a {kind}{text}", got=value)


def keep_tuples(settings: Any) -> None:
    """Make tuples of a frozen dataclass's lists and arrays, once they are checked: a list is no key of a cache."""
    for field in fields(settings):
        value, kinds = getattr(settings, field.name), (field.type, *get_args(field.type))
        if value is not None and any(get_origin(kind) is tuple for kind in kinds):
            object.__setattr__(settings, field.name, tuple(value))


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _parts(name: str, value: Any, types: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return a vector's numbers, as many as its type says."""
    listed = value.tolist() if hasattr(value, "tolist") else value  # of numpy
    parts = tuple(listed) if isinstance(listed, Sequence) else ()
    if not parts or (... not in types and len(parts) != len(types)):
        raise DockairError(name, expected="numbers" if ... in types else f"{len(types)} numbers", got=listed)
    return parts


def check_choice(name: str, value: Any, exists: tuple[str | None, ...]) -> None:
    """Refuse a value that is none of those that exist."""
    if not (value is None or isinstance(value, str)) or value not in exists:
        expected = f"{'None or ' if None in exists else ''}one of those that exist"
        raise DockairError(name, expected=expected, got=value, exists=[one for one in exists if one is not None])
