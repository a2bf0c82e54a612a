"""Tables as plain arrays, and as DataFrames once somebody asks for them.

Loading pandas takes longer than integrating a short run, and the command ``run`` needs none of it. Modules that it
loads take ``pd`` from here, which is pandas from its first use on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from vibroplat.columns import Columns, unit_of

if TYPE_CHECKING:
    import pandas


class _Pandas:
    """Pandas, which is loaded when one of its names is first used."""

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module("pandas"), name)


if TYPE_CHECKING:
    pd = pandas
else:
    pd = _Pandas()


class CategoryColumn(NamedTuple):
    """A column of a table, with one of a few words in each row.

    Attributes
    ----------
    numbers
        Which of the words each row has, shape (rows,).
    words
        The words.
    categorical
        Whether they are categories in a DataFrame.
    """

    numbers: npt.NDArray[Any]
    words: Sequence[str]
    categorical: bool = False

    def texts(self) -> list[str]:
        """Return the word of each row."""
        return [self.words[number] for number in self.numbers.tolist()]


@dataclass(frozen=True)
class ArrayTable:
    """A table, or a part of it, as arrays.

    Attributes
    ----------
    columns
        Columns by their names.
    described
        What they mean.
    """

    columns: Mapping[str, npt.NDArray[Any] | CategoryColumn]
    described: Columns

    @property
    def attrs(self) -> dict[str, dict[str, str]]:
        """Units and meanings of the columns, as in the ``attrs`` of :attr:`frame`."""
        return _attributes(self.columns, self.described)

    @cached_property
    def frame(self) -> pd.DataFrame:
        """The table as a DataFrame."""
        columns: dict[str, Any] = dict(self.columns)
        for name, column in self.columns.items():
            if isinstance(column, CategoryColumn) and column.categorical:
                columns[name] = pd.Categorical.from_codes(column.numbers, categories=pd.Index(column.words))
            elif isinstance(column, CategoryColumn):
                columns[name] = np.array(column.texts(), dtype=object)
        return add_descriptions(pd.DataFrame(columns), self.described)


class _Labels(dict[str, str]):
    """Texts by column, which tables made from others share: pandas would copy them at each step."""

    def __deepcopy__(self, _: object) -> _Labels:
        return self


def _attributes(columns: Iterable[str], described: Columns) -> dict[str, dict[str, str]]:
    """Return units of columns, and meanings of those that are described."""
    return {
        "units": _Labels((name, unit_of(name)) for name in columns),
        "meanings": _Labels((name, described[name].text) for name in columns if name in described),
    }


def share_descriptions(table: pd.DataFrame) -> pd.DataFrame:
    """Let a table that was read share its units and meanings with those made from it, and return it."""
    table.attrs = {name: _Labels(texts) if isinstance(texts, dict) else texts for name, texts in table.attrs.items()}
    return table


def add_descriptions(table: pd.DataFrame, columns: Columns) -> pd.DataFrame:
    """Put units and meanings of a table's columns into its ``attrs``, and return it."""
    table.attrs |= _attributes([str(name) for name in table], columns)
    return table
