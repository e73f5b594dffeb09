"""numba's `njit` for kernels that use constants of other files: their values are part of the key in the cache.

numba freezes globals into the machine code that it keeps on disk, but looks for it by source file, bytecode and closure
alone: after an edit of a constant in another file a kernel would go on with the old value, and say nothing.

Not seen: an edit of a kernel of another file, which `tests/test_kernels.py` therefore refuses.
"""

import pickle
from collections.abc import Callable, Iterator
from hashlib import sha256
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
from numba.core.caching import FunctionCache


def njit(*, cache: bool, **options: object) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function as `numba.njit` does.

    Args:
        cache: whether to keep the machine code on disk, found again by the values of `constants` as well.
        options: as of `numba.njit`.
    """

    def compiled(function: Callable[..., Any]) -> Any:
        kernel: Any = numba.njit(**options)(function)  # type: ignore[call-overload]
        if cache and kernel is not function:  # it is where NUMBA_DISABLE_JIT is set
            # in place of what numba's own `cache=True` puts here
            kernel._cache = _Cache(function)  # type: ignore[no-untyped-call]
        return kernel

    return compiled


def constants(function: FunctionType) -> dict[str, object]:
    """Return name, with its module's, -> value of the globals that a kernel uses, itself or in the kernels it calls."""
    found: dict[str, object] = {}
    pending, seen = [function], {function}
    while pending:
        user = pending.pop()
        for name in user.__globals__.keys() & set(_names(user.__code__)):
            value = user.__globals__[name]
            called = getattr(value, "py_func", None)
            if called is not None and called not in seen:
                seen.add(called)
                pending.append(called)
            elif not callable(value) and not isinstance(value, ModuleType):
                found[f"{user.__module__}.{name}"] = value
    return found


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names that are looked up in a function or in one inside it; of attributes, too, which does no harm."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)


class _Cache(FunctionCache):
    """numba's cache of one kernel, with the values of its constants in the key."""

    def _index_key(self, sig: object, codegen: object) -> tuple[object, ...]:
        digest = sha256()
        for name, value in sorted(constants(self._py_func).items()):
            digest.update(name.encode())
            digest.update(pickle.dumps(value))  # one by one: what they share in memory makes no difference
        key: tuple[object, ...] = super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]
        return (*key, digest.hexdigest())
