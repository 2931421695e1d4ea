"""Rows of CSV files that C++ writes, against Python's own texts of numbers."""

import csv
import io

import numpy as np
import pytest

from bellcrank._step import csv_rows
from bellcrank.files.csv_files import write_table

EDGES = [
    0.0, -0.0, 1.0, -1.0, 0.1, 1e-4, 9.999999999999999e-5, 1e15, 9999999999999998.0, 1e16, 1.5e16, 1e22, 5e-324,
    1.7976931348623157e308, 2.2250738585072014e-308, -123456.789, 100.0, 1 / 3,
]  # fmt: skip


def lines(columns, *, blank=False):
    return csv_rows(columns, blank=blank).decode().splitlines()


@pytest.mark.tier2
def test_numbers_are_written_as_repr_writes_them():
    rng = np.random.default_rng(0)
    bits = rng.integers(0, 2**64, 200_000, dtype=np.uint64).view(np.float64)
    usual = rng.normal(size=50_000) * 10.0 ** rng.integers(-20, 20, 50_000)
    whole = rng.integers(-(2**55), 2**55, 50_000).astype(float)
    values = np.concatenate([EDGES, bits[np.isfinite(bits)], usual, whole, np.round(usual, 3)])
    assert lines([values]) == list(map(repr, values.tolist()))


def test_numbers_that_are_not_finite_are_names_or_empty_cells():
    values = np.array([np.nan, -np.nan, np.inf, -np.inf, 1.0])
    assert lines([values, values]) == ["nan,nan", "nan,nan", "inf,inf", "-inf,-inf", "1.0,1.0"]
    assert lines([values, values], blank=True) == [",", ",", ",", ",", "1.0,1.0"]


def test_columns_may_be_parts_of_a_table_and_texts_by_their_codes():
    table = np.arange(6.0).reshape(3, 2)
    codes = np.array([1, 0, 1], dtype=np.int32)
    assert lines([*table.T, (codes, ["größer", '"a, b"'])]) == ['0.0,1.0,"a, b"', "2.0,3.0,größer", '4.0,5.0,"a, b"']


def test_columns_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="differ in length"):
        csv_rows([np.zeros(2), np.zeros(3)], blank=False)
    with pytest.raises(ValueError, match="no text"):
        csv_rows([(np.array([2], dtype=np.int32), ["a", "b"])], blank=False)


def test_a_table_is_read_back_exactly(tmp_path):
    table = np.random.default_rng(1).normal(size=(3000, 4))
    path = write_table(
        tmp_path / "t.csv", [("a", "m"), ("=b", "m"), ("c, d", "1"), ("ä", "N")], [table[:10], table[10:]]
    )
    rows = list(csv.reader(io.StringIO(path.read_text("utf-8"))))
    assert rows[0] == ["a [m]", "'=b [m]", "c, d [1]", "ä [N]"]
    np.testing.assert_array_equal(np.array(rows[1:], dtype=float), table)
