"""What the quick compiler leaves out changes no result, and nothing of numba for anybody else."""

from __future__ import annotations

import gc

import numba
import numpy as np
import pytest
from numba.core import types
from numba.core.types.functions import BaseFunction
from numba.core.typing.templates import infer_global

from bsmap_cli.geometry import quick_compiler
from bsmap_cli.geometry.quick_compiler import quick_compilers

KERNELS, PARTS = quick_compilers()
RULES = {"error_model": "numpy", "no_cfunc_wrapper": True}


def _power(values, n):
    result = np.ones_like(values)
    for _ in range(n):
        result *= values
    return result


def _polynomial(x, coefficients):
    total = np.zeros_like(x)
    for k in range(len(coefficients)):
        total += coefficients[k] * _power(x, k)
    return total, max(total), min(len(x), 3) / 0.0


@pytest.fixture
def part():
    """The power as a part, which nothing but compiled code can call."""
    made = numba.njit(no_cpython_wrapper=True, pipeline_class=PARTS, **RULES)(_power)
    infer_global(_power, types.Dispatcher(made))
    return made


def test_there_are_quick_compilers_for_the_numba_here():
    assert KERNELS is not None
    assert PARTS is not None


def test_a_kernel_with_a_part_gives_what_it_gives_as_written(part):
    kernel = numba.njit(pipeline_class=KERNELS, **RULES)(_polynomial)
    x, coefficients = np.linspace(-2.0, 2.0, 7), np.array([1.0, -0.5, 0.25, 3.0])
    total, largest, infinite = kernel(x, coefficients)
    expected = np.polynomial.polynomial.polyval(x, coefficients)
    np.testing.assert_allclose(total, expected, rtol=1e-14)
    assert largest == total.max()
    assert infinite == np.inf
    assert [len(part.signatures), len(kernel.signatures)] == [1, 1]


def test_another_type_is_another_variant():
    kernel = numba.njit(pipeline_class=KERNELS, **RULES)(lambda a, b: a * b)
    assert kernel(3, 4) == 12
    assert kernel(0.5, 4) == 2.0
    np.testing.assert_array_equal(kernel(np.arange(3), 2), [0, 2, 4])
    assert len(kernel.signatures) == 3


def test_what_cannot_be_typed_is_an_error_of_numba():
    kernel = numba.njit(pipeline_class=KERNELS, **RULES)(lambda a: a + "x")
    with pytest.raises(numba.TypingError):
        kernel(1.0)


def test_numba_is_left_as_it_was():
    before = BaseFunction.get_call_type, gc.get_threshold()
    numba.njit(pipeline_class=KERNELS, **RULES)(lambda a: a + 1)(2)
    assert (BaseFunction.get_call_type, gc.get_threshold()) == before


@pytest.mark.parametrize("version", ["0.60.1", "0.99.0", "1.0.0rc1"])
def test_a_numba_it_was_not_tried_with_compiles_by_itself(version, monkeypatch):
    monkeypatch.setattr(numba, "__version__", version)
    assert quick_compilers() == (None, None)


def test_a_numba_with_other_modules_compiles_by_itself(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(quick_compiler, "import_module", missing)
    assert quick_compilers() == (None, None)
