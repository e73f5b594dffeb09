"""numba's `njit` with a cache that sees edits of other files: of constants, and of the kernels that a kernel calls.

numba freezes both into the machine code that it keeps on disk, but looks for it by source file, bytecode and closure
alone: after an edit of another file a kernel would go on with the old value or code, and say nothing.

Not seen: what stands behind a module's name, and intrinsics; `tests/test_kernels.py` refuses both.

To import this also says what LLVM may use of the processor, see `features_for`: for every kernel of the process, unless
numba has compiled one already or NUMBA_CPU_FEATURES is set.
"""

import pickle
from collections.abc import Callable, Iterator
from hashlib import sha256
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.codegen import get_host_cpu_features

from dockair.errors import MachineError

_AT_FULL_RATE = "+avx512bitalg"  # of Ice Lake, Zen 4 and later: before, 512 bits at once lower the clock rate


def features_for(host: str) -> str:
    """Return a processor's features as LLVM is to use them: vectors of 512 bits where they cost no clock rate.

    Left to itself LLVM keeps to 256 bits on all of Intel's. No bit of what is computed depends on it.

    Args:
        host: features, as LLVM writes them: "+avx2,-sse4a".
    """
    return f"{host},-prefer-256-bit" if _AT_FULL_RATE in host.split(",") else host


_config: Any = numba.config
if _config.CPU_FEATURES is None:
    _config.CPU_FEATURES = features_for(get_host_cpu_features())  # type: ignore[no-untyped-call]


def njit(*, cache: bool, **options: object) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function as `numba.njit` does.

    Args:
        cache: whether to keep the machine code on disk, found again by its `ingredients` as well.
        options: as of `numba.njit`.
    """

    def compiled(function: Callable[..., Any]) -> Any:
        kernel: Any = numba.njit(**options)(function)  # type: ignore[call-overload]
        if cache and kernel is not function:  # it is where NUMBA_DISABLE_JIT is set
            # in place of what numba's own `cache=True` puts here
            kernel._cache = _made_cache(function)
        return kernel

    return compiled


def _made_cache(function: Callable[..., Any]) -> FunctionCache:
    try:
        return _Cache(function)  # type: ignore[no-untyped-call]
    except RuntimeError as error:  # neither the package's folder nor the user's can be written
        remedy = "set NUMBA_CACHE_DIR to a folder that can be written"
        raise MachineError("kernels", expected="a folder to keep compiled code in", remedy=remedy) from error


def ingredients(function: FunctionType) -> dict[str, object]:
    """Return name, with its module's, -> what a kernel uses of its globals, itself or in the kernels it calls.

    Constants stand with their values, kernels with their options and code, named tuples with their fields' names.
    """
    found: dict[str, object] = {}
    pending, seen = [function], {function}
    while pending:
        user = pending.pop()
        for name in user.__globals__.keys() & set(_names(user.__code__)):
            value = user.__globals__[name]
            called = getattr(value, "py_func", None)
            if called is not None:
                found[f"{called.__module__}.{called.__qualname__}"] = _options(value), _content(called.__code__)
                if called not in seen:
                    seen.add(called)
                    pending.append(called)
            elif isinstance(value, type) and (fields := getattr(value, "_fields", None)) is not None:
                found[f"{value.__module__}.{value.__qualname__}"] = fields
            elif not callable(value) and not isinstance(value, ModuleType):
                found[f"{user.__module__}.{name}"] = value
    return found


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names that are looked up in a function or in one inside it; of attributes, too, which does no harm."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)


def _options(kernel: Any) -> str:
    return repr(sorted((name, repr(value)) for name, value in kernel.targetoptions.items()))


def _content(code: CodeType) -> tuple[object, ...]:
    """What a function does, wherever it stands: neither its file's name nor its lines'."""
    constants = (_content(value) if isinstance(value, CodeType) else repr(value) for value in code.co_consts)
    return code.co_code, code.co_names, code.co_varnames, code.co_freevars, *constants


class _Cache(FunctionCache):
    """numba's cache of one kernel, with its ingredients in the key."""

    def _index_key(self, sig: object, codegen: object) -> tuple[object, ...]:
        digest = sha256()
        for name, value in sorted(ingredients(self._py_func).items(), key=lambda item: item[0]):
            digest.update(name.encode())
            digest.update(pickle.dumps(value))  # one by one: what they share in memory makes no difference
        key: tuple[object, ...] = super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]
        return (*key, digest.hexdigest())
