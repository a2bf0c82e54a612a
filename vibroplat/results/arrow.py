"""Plain tables for Parquet files, to the byte as pyarrow and pandas make them of DataFrames, without loading pandas.

``pyarrow.array`` loads it to see whether it was given one of its objects: here arrays are made of their buffers.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from vibroplat.frames import ArrayTable, CategoryColumn


def arrow_table(part: ArrayTable) -> pa.Table:
    """Return a part of a table, with what tells pandas how to read it."""
    arrays, columns = {}, []
    for name, column in part.columns.items():
        arrays[name], kind, dtype, more = _array(column)
        columns.append({"name": name, "field_name": name, "pandas_type": kind, "numpy_type": dtype, "metadata": more})
    about = {"index_columns": [], "column_indexes": [], "columns": columns, "attributes": part.attrs}
    about |= {"creator": {"library": "pyarrow", "version": pa.__version__}, "pandas_version": version("pandas")}
    return pa.table(arrays).replace_schema_metadata({"pandas": json.dumps(about)})


def _array(column: npt.NDArray[Any] | CategoryColumn) -> tuple[pa.Array, str, str, dict[str, Any] | None]:
    """Return a column, the names that pandas and numpy have for its type, and what else pandas is told."""
    if not isinstance(column, CategoryColumn):
        return _numbers(column), str(column.dtype), str(column.dtype), None
    if column.categorical:
        array = pa.DictionaryArray.from_arrays(_numbers(column.numbers.astype(np.int8)), _texts(column.words))
        return array, "categorical", "int8", {"num_categories": len(column.words), "ordered": False}
    if not column.numbers.size:  # pandas cannot know that these are texts
        return pa.nulls(0), "empty", "object", None
    return _texts(column.texts()), "object", "str", None


def _numbers(column: npt.NDArray[Any]) -> pa.Array:
    """Return numbers; nan is null in files."""
    known = ~np.isnan(column)
    valid = None if known.all() else pa.py_buffer(np.packbits(known, bitorder="little"))
    values = pa.py_buffer(np.ascontiguousarray(column))
    return pa.Array.from_buffers(pa.from_numpy_dtype(column.dtype), column.size, [valid, values])


def _texts(texts: Sequence[str]) -> pa.Array:
    """Return texts."""
    encoded = [text.encode() for text in texts]
    ends = pa.py_buffer(np.cumsum([0, *map(len, encoded)], dtype=np.int64))
    return pa.Array.from_buffers(pa.large_string(), len(texts), [None, ends, pa.py_buffer(b"".join(encoded))])
