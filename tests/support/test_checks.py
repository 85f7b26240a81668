from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import torch

from unload.support import checks
from unload.support.checks import entries, finite_array, flag_array, integer_array, shaped


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


def test_finite_array_returns_a_copy():
    given = np.zeros((1, 3))
    finite_array("a", given, (None, 3))[0] = 5
    assert not given.any()


@pytest.mark.parametrize(
    ("check", "value", "arguments", "dtype"),
    [
        (finite_array, np.array([[0, 1]]), ((None, 2),), np.float64),
        (integer_array, np.array([0, 1], np.int8), ((None,),), np.int64),
        (integer_array, [0, 3], ((2,), 3), np.int64),
        *(
            (flag_array, value, ((2,),), bool)
            for value in ([False, True], [0.0, 1.0], np.array([0, 1], np.int8))
        ),
    ],
)
def test_arrays_are_returned_in_one_dtype(check, value, arguments, dtype):
    array = check("a", value, *arguments)
    assert array.dtype == dtype and array.tolist() == np.asarray(value).tolist()


@pytest.mark.parametrize(
    ("check", "value", "arguments", "error", "message"),
    [
        (entries, {"c": 3}, (("b", "a"),), ValueError, "a has no a, b; expected b, a"),
        (finite_array, [[1.0, 2.0]], ((None, 3),), ValueError, r"expected \(any, 3\)"),
        (finite_array, [[1, -np.inf]], (None,), ValueError, r"holds -inf at index \(0, 1\)"),
        (finite_array, [True], (None,), TypeError, "has dtype bool; expected real numbers"),
        (finite_array, torch.ones(3, requires_grad=True), (None,), TypeError, "be read as an"),
        (integer_array, [1.0, 2.0], ((2,),), TypeError, "dtype float64; expected integers"),
        (integer_array, [True, False], ((2,),), TypeError, "dtype bool; expected integers"),
        (integer_array, [-1, 3], ((2,), 3), ValueError, "holds -1 to 3; expected 0 to 3"),
        (integer_array, [0, 4], ((2,), 3), ValueError, "holds 0 to 4; expected 0 to 3"),
        (shaped, np.zeros(2, np.float32), ((2,), float), TypeError, "ndarray of dtype float32;"),
        (shaped, [0.0, 0.0], ((2,), float), TypeError, "a is a list of dtype None; expected"),
        (flag_array, [2, 0], ((2,),), ValueError, "holds 2; expected bool, or 0 and 1"),
        (flag_array, [np.nan, 0], ((2,),), ValueError, "a holds nan; expected bool, or"),
    ],
)
def test_arrays_and_entries_that_do_not_fit_are_refused(check, value, arguments, error, message):
    with pytest.raises(error, match=message):
        check("a", value, *arguments)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (ImportError("-", name="torch"), r'^it needs torch, .* pip install "\.\[train\]"$'),
        (ImportError("Missing optional dependency 'openpyxl'"), r"^it needs openpyxl, .*\[excel\]"),
        (ImportError("no such library", name="nosuch"), "^no such library$"),
    ],
)
def test_a_library_that_is_missing_is_named_with_the_extra_that_brings_it(error, message):
    with pytest.raises(ImportError, match=message), checks.needed_for("it"):
        raise error
