"""Numbers side by side, against numpy, for one lane and for several."""

import numpy as np
import pytest

from vibroplat.kernels.compiled import compiled
from vibroplat.kernels.lanes import (
    as_lanes,
    exp2,
    greater,
    join,
    lanes_record,
    lesser,
    log2,
    nearest,
    part,
    select,
    size,
    some,
    zero,
)

FIELDS = {"a": (1,), "b": (1,), "rows": (3, 1), "out": (12, 1), "any": (2, 1)}


@compiled
def compute(record):
    s = as_lanes(record)
    a, b, out = s.a, s.b, s.out
    out[0], out[1], out[2] = a + 2.0 * b, a / b - 1.0, -(a * b)
    out[3], out[4] = greater(a, b), lesser(a, 0.5)
    out[5] = select((a > b) & (b <= 0.0) | (a == 1.0), size(b), nearest(a))
    total = zero(a)
    for i in range(3):
        total += s.rows[i]
    out[6] = total
    (out[7], out[8]), (out[9], _) = part(join(a, b) * join(b, 3.0)), part(2.0 * join(a, b))
    out[10], out[11] = log2(size(a)), exp2(b)
    s.any[0] = select(some(a < b), a, b)
    s.any[1] = select(some(a > 1e9), a, b)


@pytest.mark.parametrize("width", [1, 2, 4, 8])
def test_lanes_compute_as_numbers_do(width):
    record, random = lanes_record(width, FIELDS, {"both": ("a", (2, 1))}), np.random.default_rng(3)
    record["both"][:] = random.normal(size=(2, width))
    record["a"][0] = 1.0
    record["rows"][:] = random.normal(size=(3, width))
    compute(record)
    a, b = record["a"], record["b"]
    chosen = np.where(((a > b) & (b <= 0.0)) | (a == 1.0), np.abs(b), np.rint(a))
    expected = [a + 2.0 * b, a / b - 1.0, -a * b, np.maximum(a, b), np.minimum(a, 0.5), chosen]
    expected += [record["rows"].sum(axis=0), a * b, 3.0 * b, 2.0 * a]
    np.testing.assert_allclose(record["out"][:10], expected, rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(record["out"][10:], [np.log2(np.abs(a)), np.exp2(b)], rtol=1e-7, atol=1e-7)
    np.testing.assert_array_equal(record["any"], [a if (a < b).any() else b, b])


def test_comparisons_with_no_number_are_false():
    record = lanes_record(4, FIELDS, {})
    record["a"][:], record["b"][:] = np.nan, [1.0, -1.0, 0.0, np.nan]
    compute(record)
    np.testing.assert_array_equal(record["out"][3], record["b"])
    np.testing.assert_array_equal(record["any"][0], record["b"])
