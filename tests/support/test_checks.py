from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import torch

from unload.support import checks


@pytest.mark.parametrize(
    ("check", "value", "arguments"),
    [
        *((checks.integer, value, (0, 5)) for value in (0, 5, np.int64(2), np.uint8(2))),
        (checks.integer, np.uint64(2**63 - 1), (1,)),
        *((checks.real, value, (0, 1)) for value in (0, 1, np.float32(0.25), np.int8(1))),
        *((checks.boolean, value, ()) for value in (True, False, np.True_)),
        *((checks.one_of, value, (("red", None),)) for value in ("red", None)),
        *((check, Path("a/b"), ()) for check in (checks.path, checks.file)),
    ],
)
def test_numbers_are_returned_as_pythons_own(check, value, arguments):
    result = check("n", value, *arguments)
    kind = {checks.real: float, checks.boolean: bool, checks.integer: int}.get(check, type(value))
    assert result == value and type(result) is kind


@pytest.mark.parametrize(
    ("check", "value", "arguments", "error", "wanted"),
    [
        (checks.integer, True, (0, 5), TypeError, "an integer >= 0 and <= 5"),
        (checks.integer, 2.0, (0, 5), TypeError, "an integer >= 0 and <= 5"),
        (checks.integer, 6, (0, 5), ValueError, "an integer >= 0 and <= 5"),
        (checks.integer, 0, (1,), ValueError, "an integer >= 1"),
        (checks.integer, 2**63, (1,), ValueError, "an integer >= 1"),  # negative in an array
        (checks.real, True, (0, 1), TypeError, "a number in [0, 1]"),
        (checks.real, Decimal("0.5"), (0, 1), TypeError, "a number in [0, 1]"),
        (checks.real, -0.1, (0, 1), ValueError, "a number in [0, 1]"),
        (checks.real, 1.1, (0, 1), ValueError, "a number in [0, 1]"),
        (checks.real, np.inf, (0,), ValueError, "a number >= 0"),
        (checks.real, np.nan, (0,), ValueError, "a number >= 0"),
        (checks.boolean, 1, (), TypeError, "True or False"),
        (checks.path, 3, (), TypeError, "a path"),
        (checks.entries, ["a"], ((),), TypeError, "a dict"),
        (checks.file, "/", (), ValueError, "the name of a file"),
        (checks.one_of, "blue", (("red", None, 1),), ValueError, "one of 'red', None, 1"),
        (checks.one_of, torch.ones(2), (("red", 1),), ValueError, "one of 'red', 1"),
    ],
)
def test_what_does_not_fit_is_refused_by_name_and_value(check, value, arguments, error, wanted):
    with pytest.raises(error) as caught:
        check("n", value, *arguments)
    assert str(caught.value) == f"n is {value!r}; expected {wanted}"


def test_entries_names_what_is_missing():
    with pytest.raises(ValueError, match="state has no a, b; expected b, a"):
        checks.entries("state", {"c": 3}, ("b", "a"))


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
        ([[1, -np.inf, np.nan]], ValueError, r"a holds -inf at index \(0, 1\)"),
        ([[True, True, True]], TypeError, "a has dtype bool; expected real numbers"),
        (torch.ones(1, 3, requires_grad=True), TypeError, "a cannot be read as an array"),
    ],
)
def test_finite_array_refuses(value, error, message):
    with pytest.raises(error, match=message):
        checks.finite_array("a", value, (None, 3))


def test_integer_array():
    array = checks.integer_array("a", np.array([1, 2], np.int8), (None,))
    assert array.dtype == np.int64 and array.tolist() == [1, 2]
    for value in ([1.0, 2.0], [True, False]):
        with pytest.raises(TypeError, match="a has dtype .*; expected integers"):
            checks.integer_array("a", value, (2,))
    assert checks.integer_array("a", [0, 3], (2,), high=3).tolist() == [0, 3]
    for value in ([-1, 3], [0, 4]):
        with pytest.raises(ValueError, match=f"a holds {value[0]} to {value[1]}; expected 0 to 3"):
            checks.integer_array("a", value, (2,), high=3)


def test_shaped():
    checks.shaped("a", np.zeros((2, 3)), (None, 3), np.float64)
    for value in (np.zeros((2, 3), np.float32), [[0.0] * 3] * 2):
        with pytest.raises(TypeError, match="a is a .* of dtype .*; expected <class"):
            checks.shaped("a", value, (None, 3), np.float64)


def test_flag_array():
    for value in ([True, False], [1, 0], [1.0, 0.0], np.array([1, 0], np.int8)):
        array = checks.flag_array("a", value, (2,))
        assert array.dtype == bool and array.tolist() == [True, False]
    for value in ([2, 0], [np.nan, 0]):
        with pytest.raises(ValueError, match="a holds .*; expected bool, or 0 and 1"):
            checks.flag_array("a", value, (2,))
