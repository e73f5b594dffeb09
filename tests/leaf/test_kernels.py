"""Kernels found again in numba's cache by the values of their constants too, compiled and loaded from a folder."""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType

import numpy as np
import pytest

from dockair.kernels import constants, njit

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


@pytest.fixture
def load(tmp_path, monkeypatch):
    """Function that imports the kernels anew, as another process would, where CODE is what it says."""

    def load(code: int) -> ModuleType:
        codes = ModuleType("codes_of_the_test")
        codes.CODE = code
        monkeypatch.setitem(sys.modules, codes.__name__, codes)
        path = tmp_path / "kernels_of_the_test.py"
        path.write_text(SOURCE)
        spec = spec_from_file_location(path.stem, path)
        module = module_from_spec(spec)
        monkeypatch.setitem(sys.modules, path.stem, module)
        spec.loader.exec_module(module)
        return module

    return load


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


def test_the_constants_of_a_kernel_are_its_own_and_those_of_the_kernels_that_it_calls(load):
    module = load(7)
    assert constants(module.code.py_func) == {"kernels_of_the_test.CODE": 7}
    found = constants(module.sum_of_both.py_func)
    assert found.keys() == {"kernels_of_the_test.CODE", "kernels_of_the_test._TABLE"}
    np.testing.assert_array_equal(found["kernels_of_the_test._TABLE"], [7, 7, 7])


def test_what_is_not_to_be_kept_is_not():
    @njit(cache=False)
    def one() -> int:
        return 1

    assert one() == 1
    assert not one.stats.cache_path
