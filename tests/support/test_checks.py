from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import torch

from unload.support import checks

NO_NUMBERS = (Fraction(1, 3), Decimal("0.5"), np.array([True]), np.array(1), torch.tensor(1))


@pytest.mark.parametrize("value", [2, np.int64(2), np.uint8(2)])
def test_integer_returns_a_python_int(value):
    result = checks.integer("n", value, 2, 2)
    assert result == 2 and type(result) is int


@pytest.mark.parametrize(
    ("value", "error"),
    [(True, TypeError), (np.True_, TypeError), (2.0, TypeError), ("2", TypeError),
     (None, TypeError), (float("nan"), TypeError), (-1, ValueError), (6, ValueError)],
)  # fmt: skip
def test_integer_names_the_argument_the_value_and_the_range(value, error):
    with pytest.raises(error) as caught:
        checks.integer("n", value, 0, 5)
    message = str(caught.value)
    assert message.startswith(f"n is {value!r}; ") and ">= 0 and <= 5" in message


def test_integer_without_an_upper_bound():
    assert checks.integer("n", 10**12, 1) == 10**12
    with pytest.raises(ValueError, match="n is 0; expected an integer >= 1$"):
        checks.integer("n", 0, 1)
    assert checks.integer("n", np.uint64(2**63 - 1), 1) == 2**63 - 1
    for value in (2**63, np.uint64(2**63)):  # would be negative in an array
        with pytest.raises(ValueError, match="n is .*9223372036854775808.*; expected"):
            checks.integer("n", value, 1)


@pytest.mark.parametrize("value", [0, 1, 0.25, np.float32(0.25), np.int8(1), np.longdouble(0.25)])
def test_real_returns_a_python_float(value):
    result = checks.real("x", value, 0, 1)
    assert result == value and type(result) is float


@pytest.mark.parametrize(
    ("value", "error"),
    [(True, TypeError), ("1", TypeError), (None, TypeError), (1j, TypeError),
     (float("nan"), ValueError), (float("inf"), ValueError), (-0.1, ValueError),
     (1.1, ValueError)],
)  # fmt: skip
def test_real_refuses(value, error):
    with pytest.raises(error, match="^x is .*expected a .*number in "):
        checks.real("x", value, 0, 1)


def test_one_of_lists_the_options():
    checks.one_of("colour", "red", ("red", None))
    checks.one_of("colour", None, ("red", None))
    with pytest.raises(ValueError, match="colour is 'blue'; expected one of 'red', None"):
        checks.one_of("colour", "blue", ("red", None))


@pytest.mark.parametrize(
    "value",
    [np.array(["red", "red"]), np.array(["red"]), torch.ones(2), ["red"], {"red": 1}, float("nan")],
)
def test_one_of_refuses_what_is_not_one_value(value):
    with pytest.raises(ValueError, match="colour is .*; expected one of 'red', None, 1"):
        checks.one_of("colour", value, ("red", None, 1))


@pytest.mark.parametrize("value", [True, False, np.True_])
def test_boolean_returns_a_python_bool(value):
    result = checks.boolean("flag", value)
    assert result == value and type(result) is bool


@pytest.mark.parametrize("value", [1, 0, 1.0, None, "yes", np.array([True])])
def test_boolean_refuses(value):
    with pytest.raises(TypeError, match="flag is .*; expected True or False"):
        checks.boolean("flag", value)


def test_paths_and_generators(rng):
    assert checks.path("x", "a/b") == Path("a/b") and checks.generator("x", rng) is rng
    for check, wanted in ((checks.path, "path"), (checks.generator, "numpy.random.Generator")):
        with pytest.raises(TypeError, match=f"x is 3; expected a {wanted}"):
            check("x", 3)


def test_entries_names_what_is_missing():
    checks.entries("state", {"a": 1, "b": 2, "c": 3}, ("a", "b"))
    with pytest.raises(ValueError, match="state has no a, b; expected b, a"):
        checks.entries("state", {"c": 3}, ("b", "a"))
    with pytest.raises(TypeError, match=r"state is \['a'\]; expected a dict"):
        checks.entries("state", ["a"], ())


def test_finite_array_returns_a_float64_copy():
    given = np.array([[1, 2, 3]])
    array = checks.finite_array("a", given, (None, 3))
    assert array.dtype == np.float64 and array.tolist() == [[1, 2, 3]]
    same_dtype = np.zeros((1, 3))
    checks.finite_array("a", same_dtype, (None, 3))[0] = 5
    assert not same_dtype.any()


@pytest.mark.parametrize(
    ("value", "error", "message"),
    [
        ([[1.0, 2.0]], ValueError, r"a has shape \(1, 2\); expected \(any, 3\)"),
        ([[1.0, 2.0, 3.0, 4.0]], ValueError, r"a has shape \(1, 4\)"),
        ([1.0, 2.0, 3.0], ValueError, r"a has shape \(3,\)"),
        ([[1, 2, np.nan]], ValueError, r"a holds nan at index \(0, 2\)"),
        ([[1, -np.inf, 0]], ValueError, r"a holds -inf at index \(0, 1\)"),
        ([["1", "2", "3"]], TypeError, "a has dtype <U1"),
        ([[True, True, True]], TypeError, "a has dtype bool"),
        ([[1j, 0, 0]], TypeError, "a has dtype complex128"),
        ([[1.0], [1.0, 2.0]], TypeError, "a cannot be read as an array"),
        ([], ValueError, r"a has shape \(0,\); expected \(any, 3\)"),
        ([[10**400, 0, 0]], TypeError, "a has dtype object; expected real numbers"),
        ([[Fraction(1, 3), 0, 0]], TypeError, "a has dtype object; expected real numbers"),
        (torch.ones(1, 3, requires_grad=True), TypeError, "a cannot be read as an array"),
    ],
)
def test_finite_array_refuses(value, error, message):
    with pytest.raises(error, match=message):
        checks.finite_array("a", value, (None, 3))


def test_a_number_of_processes():
    assert [checks.jobs("n_jobs", count) for count in (-2, -1, 1, 8)] == [-2, -1, 1, 8]
    with pytest.raises(ValueError, match="n_jobs is 0; expected a number of processes, or -1"):
        checks.jobs("n_jobs", 0)
    with pytest.raises(TypeError, match="n_jobs is 2.0; expected an integer"):
        checks.jobs("n_jobs", 2.0)


def test_integer_array():
    array = checks.integer_array("a", np.array([1, 2], np.int8), (None,))
    assert array.dtype == np.int64 and array.tolist() == [1, 2]
    for value in ([1.0, 2.0], [True, False], ["1", "2"], [None, None]):
        with pytest.raises(TypeError, match="a has dtype .*; expected integers"):
            checks.integer_array("a", value, (2,))
    with pytest.raises(ValueError, match=r"a has shape \(1,\); expected \(2,\)"):
        checks.integer_array("a", [1], (2,))


def test_flag_array():
    for value in ([True, False], [1, 0], [1.0, 0.0], np.array([1, 0], np.int8)):
        array = checks.flag_array("a", value, (2,))
        assert array.dtype == bool and array.tolist() == [True, False]
    for value in ([2, 0], [-1, 0], [np.nan, 0], [0.5, 1]):
        with pytest.raises(ValueError, match="a holds .*; expected bool, or 0 and 1"):
            checks.flag_array("a", value, (2,))
    with pytest.raises(TypeError, match="a has dtype <U1"):
        checks.flag_array("a", ["1", "0"], (2,))
