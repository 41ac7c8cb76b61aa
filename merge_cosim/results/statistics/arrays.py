"""Result rows as arrays: parts of them are taken a hundred times faster than of a table of pandas."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
import pandas as pd

from merge_cosim.core.units import AnyArray, BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class RowArrays:
    """Rows of n cases under any methods.

    Attributes:
        numbers: Columns of numbers and flags, shape (rows,) each; a flag is 0 or 1, what is missing is NaN.
        case: Number of the case of each row among `case_names`, shape (rows,).
        car: Number of its merging car among `car_names`, shape (rows,).
        case_names, car_names: The names.
    """

    numbers: dict[str, FloatArray]
    case: IntArray
    car: IntArray
    case_names: AnyArray
    car_names: AnyArray

    @classmethod
    def of(cls, rows: pd.DataFrame, columns: Iterable[str]) -> Self:
        """The named columns of a table, and whose rows they are."""
        numbers = {name: rows[name].to_numpy(dtype=float, na_value=np.nan) for name in columns}
        (case, cases), (car, cars) = (pd.factorize(rows[name]) for name in ("case", "car"))
        return cls(numbers, case, car, *(names.to_numpy(dtype=object) for names in (cases, cars)))

    def __len__(self) -> int:
        return len(self.case)

    def __getitem__(self, name: str) -> FloatArray:
        """A column."""
        return self.numbers[name]

    def take(self, which: IntArray | BoolArray) -> RowArrays:
        """Some of the rows."""
        numbers = {name: values[which] for name, values in self.numbers.items()}
        return RowArrays(numbers, self.case[which], self.car[which], self.case_names, self.car_names)

    def flag(self, name: str) -> BoolArray:
        """Where a flag is known and set."""
        found: BoolArray = self.numbers[name] == 1.0
        return found

    def known(self, name: str) -> BoolArray:
        """Where a column has a value."""
        return ~np.isnan(self.numbers[name])

    @property
    def logged(self) -> BoolArray:
        """Whether each row has a merging car of a log."""
        found: BoolArray = (self.car_names != "")[self.car]
        return found

    def clusters(self) -> AnyArray:
        """The cluster of each row: its merging car; where that is not logged, its case."""
        return np.where(self.logged, self.car_names[self.car], self.case_names[self.case])

    def outcomes(self) -> IntArray:
        """Of each of the n cases by its first row: 1 failed, 0 did not, -1 is not here or censored; shape (n,)."""
        found = np.full(len(self.case_names), -1)
        outcome = np.where(self.flag("censored"), -1, self.flag("failed"))
        found[self.case[::-1]] = outcome[::-1]
        return found
