"""Kernels found again in numba's cache by what they are made of elsewhere too, compiled and loaded from a folder."""

import os
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType

import numpy as np
import pytest
from numba.core.codegen import get_host_cpu_features

from dockair import kernels
from dockair.errors import MachineError
from dockair.kernels import features_for, ingredients, njit

SOURCE = """
import numpy as np
from dockair.kernels import njit
from codes_of_the_test import CODE

_TABLE = np.full(3, CODE)

@njit(cache=True)
def code():
    return CODE

@njit(cache=True, inline="always")
def first():
    return _TABLE[0]

@njit(cache=True)
def sum_of_both():
    return code() + first()
"""

CALLED = """
from dockair.kernels import njit

@njit(cache=True{options})
def ratio(a, b):
    return a / b {more}
"""

CALLING = """
from called_by_the_test import ratio
from dockair.kernels import njit

@njit(cache=True, error_model="numpy")
def through(a, b):
    return ratio(a, b)

@njit(cache=True, error_model="numpy")
def through_another(a, b):
    return through(a, b)
"""


@pytest.fixture
def load_source(tmp_path, monkeypatch):
    """Function that writes a module, unless it stands there, and imports it anew, as another process would.

    Python keeps no bytecode of it: it would take an edit of the same length within a second for none.
    """
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def load(name: str, source: str) -> ModuleType:
        path = tmp_path / f"{name}.py"
        if not (path.exists() and path.read_text() == source):
            path.write_text(source)
        spec = spec_from_file_location(name, path)
        module = module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture
def load(load_source, monkeypatch):
    """Function that imports the kernels anew where CODE is what it says."""

    def load(code: int) -> ModuleType:
        codes = ModuleType("codes_of_the_test")
        codes.CODE = code
        monkeypatch.setitem(sys.modules, codes.__name__, codes)
        return load_source("kernels_of_the_test", SOURCE)

    return load


@pytest.mark.parametrize(
    ("host", "asked"),
    [
        ("+avx2,-avx512f,-avx512bitalg", None),
        ("+avx2,+avx512f,-avx512bitalg", None),  # Skylake, Cascade Lake: wide vectors slow the clock
        ("+avx512bitalg,+avx512f", "+avx512bitalg,+avx512f,-prefer-256-bit"),
    ],
)
def test_the_widest_vectors_are_asked_for_where_they_cost_no_clock_rate(host, asked):
    assert features_for(host) == (asked or host)


def test_kernels_are_compiled_for_the_features_asked_for_unless_the_user_names_others():
    script = """
from dockair.kernels import njit
kernel = njit(cache=False)(lambda x: x + 1.0)
kernel(1.0)
print(next(iter(kernel.overloads.values())).library.codegen.magic_tuple()[2])
"""
    others = {name: value for name, value in os.environ.items() if name != "NUMBA_CPU_FEATURES"}
    for environment, expected in (
        ({}, features_for(get_host_cpu_features())),
        ({"NUMBA_CPU_FEATURES": "+sse2"}, "+sse2"),
    ):
        found = subprocess.run(
            [sys.executable, "-c", script], env=others | environment, capture_output=True, text=True, check=True
        )
        assert found.stdout.strip() == expected


@pytest.mark.parametrize("name, factor", [("code", 1), ("first", 1), ("sum_of_both", 2)])
def test_a_kernel_goes_by_the_constants_of_today_not_by_those_it_was_kept_with(load, name, factor):
    for code in (3, 5, 3):
        assert getattr(load(code), name)() == factor * code


def test_a_kernel_is_compiled_once_for_each_value(load):
    hits = []
    for code in (3, 3, 5, 5, 3):
        kernel = load(code).sum_of_both
        kernel()
        hits.append(sum(kernel.stats.cache_hits.values()))
    assert hits == [0, 1, 0, 1, 1]


def test_the_ingredients_of_a_kernel_are_its_own_and_those_of_the_kernels_that_it_calls(load):
    module = load(7)
    assert ingredients(module.code.py_func) == {"kernels_of_the_test.CODE": 7}
    found = ingredients(module.sum_of_both.py_func)
    assert found.keys() == {f"kernels_of_the_test.{name}" for name in ("CODE", "_TABLE", "code", "first")}
    np.testing.assert_array_equal(found["kernels_of_the_test._TABLE"], [7, 7, 7])


@pytest.mark.parametrize("name", ["through", "through_another"])
def test_a_kernel_goes_by_the_kernels_of_other_files_as_they_are_today(load_source, name):
    for more, expected in (("", 1.5), ("+ 1.0", 2.5), ("- 1.0", 0.5), ("", 1.5)):
        load_source("called_by_the_test", CALLED.format(options="", more=more))
        assert getattr(load_source("calling_for_the_test", CALLING), name)(3.0, 2.0) == expected


def test_a_kernel_goes_by_the_options_of_the_kernels_that_it_calls(load_source):
    load_source("called_by_the_test", CALLED.format(options=', error_model="python"', more=""))
    with pytest.raises(ZeroDivisionError):
        load_source("calling_for_the_test", CALLING).through(1.0, 0.0)
    load_source("called_by_the_test", CALLED.format(options=', error_model="numpy"', more=""))
    assert load_source("calling_for_the_test", CALLING).through(1.0, 0.0) == np.inf


def test_a_kernel_goes_by_the_fields_of_named_tuples_as_they_are_today(load_source):
    calling = """
from called_by_the_test import Pair, ratio
from dockair.kernels import njit

@njit(cache=True)
def of_pair(a, b):
    return ratio(Pair(a, b))
"""
    called = """
from typing import NamedTuple
from dockair.kernels import njit

class Pair(NamedTuple):
    {0}: float
    {1}: float

@njit(cache=True)
def ratio(pair):
    return pair.above / pair.below
"""
    for fields, expected in ((("above", "below"), 1.5), (("below", "above"), 1.0 / 1.5)):
        load_source("called_by_the_test", called.format(*fields))
        assert load_source("calling_for_the_test", calling).of_pair(3.0, 2.0) == expected


def test_a_kernel_is_compiled_once_for_all_places_of_the_kernels_that_it_calls(load_source):
    hits = []
    for comment in ("", "# moved down by a line\n", ""):
        load_source("called_by_the_test", comment + CALLED.format(options="", more=""))
        kernel = load_source("calling_for_the_test", CALLING).through
        kernel(3.0, 2.0)
        hits.append(sum(kernel.stats.cache_hits.values()))
    assert hits == [0, 1, 1]


def test_what_is_not_to_be_kept_is_not():
    @njit(cache=False)
    def one() -> int:
        return 1

    assert one() == 1
    assert not one.stats.cache_path


def test_no_folder_to_keep_code_in_is_what_the_machine_lacks(monkeypatch):
    def no_locator(function):
        raise RuntimeError(f"cannot cache function '{function.__name__}': no locator available")

    monkeypatch.setattr(kernels, "_Cache", no_locator)
    with pytest.raises(MachineError, match="a folder to keep compiled code in; set NUMBA_CACHE_DIR"):
        kernels.njit(cache=True)(lambda x: x)
    kernels.njit(cache=False)(lambda x: x)
