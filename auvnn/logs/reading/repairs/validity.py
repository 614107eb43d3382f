"""Values that another column of the file declares void: a DVL without bottom lock, a fix of poor quality."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError, InputError
from auvnn.logs.readers.base import Table
from auvnn.logs.reading.repairs.repair import Repair


@dataclass(frozen=True)
class Validity:
    """When a value counts.

    Args:
        source: column of the file that says so; a missing cell in it makes the value missing too.
        accepted: values of that column, numbers or words, any of which is good; empty for any.
        above: smallest number that is good, excluded.
        below: largest number that is good, excluded.
    """

    source: str
    accepted: tuple[float | str, ...] = ()
    above: float = -math.inf
    below: float = math.inf

    @classmethod
    def read(cls, data: Any, where: str) -> Validity:
        """Read `{from: column, is: value or list, above: number, below: number}`.

        Raises:
            ConfigError: a key or a value is wrong, or nothing is asked of the column.
        """
        if not isinstance(data, Mapping) or not isinstance(data.get("from"), str):
            raise ConfigError(f"{where} must say {{from: column, is: value}}, not {data!r}")
        for key in data:
            if key not in ("from", "is", "above", "below"):
                raise ConfigError(
                    f"{where}: {unknown_name('key', str(key), ('from', 'is', 'above', 'below'))}"
                )
        if len(data) == 1:
            raise ConfigError(f"{where}: asks nothing of '{data['from']}': give is, above or below")
        values = data.get("is", [])
        values = values if isinstance(values, list) else [values]
        for value in values:
            if not isinstance(value, (int, float, str)):
                raise ConfigError(f"{where}: is: {value!r} is neither a number nor a word")
        limits = {}
        for key in ("above", "below"):
            limit = data.get(key, math.inf if key == "below" else -math.inf)
            if isinstance(limit, bool) or not isinstance(limit, (int, float)) or math.isnan(limit):
                raise ConfigError(f"{where}: {key}: {limit!r} is not a number")
            limits[key] = float(limit)
        accepted = tuple(v if isinstance(v, str) else float(v) for v in values)
        return cls(data["from"], accepted, **limits)

    def mask(
        self, values: NDArray[Any], table: Table, name: str, where: str, mapping: str
    ) -> tuple[NDArray[np.float64], list[Repair]]:
        """Return the values with those missing that do not count, and their number.

        Raises:
            InputError: the file has no such column, or no row of it is good.
        """
        good = self._good(table, where, mapping)
        lost = ~good & np.isfinite(values.astype(np.float64))
        if not good.any():
            raise InputError(
                f"{where}: '{name}' is nowhere valid: '{self.source}' never is {self._words()}; check 'valid' in "
                f"{mapping}"
            )
        out = np.where(good, values.astype(np.float64), np.nan)
        if not lost.any():
            return out, []
        words = f"values of '{name}' read as missing where '{self.source}' is not {self._words()}"
        return out, [Repair(words, where, int(lost.sum()))]

    def _good(self, table: Table, where: str, mapping: str) -> NDArray[np.bool_]:
        if self.source in table.columns:
            column = table.columns[self.source].astype(np.float64)
            with np.errstate(invalid="ignore"):
                good = np.isfinite(column) & (column > self.above) & (column < self.below)
            numbers = [v for v in self.accepted if not isinstance(v, str)]
            return good & np.isin(column, numbers) if self.accepted else good
        if self.source in table.text:
            text = table.text[self.source]
            if text.codes is None:
                raise InputError(
                    f"{where}: '{self.source}' has too many different words to tell what is valid"
                )
            wanted = {str(v).strip().casefold() for v in self.accepted}
            codes = [i for i, label in enumerate(text.labels) if label.strip().casefold() in wanted]
            return np.isin(text.codes, codes)
        raise InputError(
            f"{where}: {mapping} judges by a column that is not there: "
            f"{unknown_name('column', self.source, table.names)}"
        )

    def _words(self) -> str:
        parts = [" or ".join(f"{v:g}" if isinstance(v, float) else repr(v) for v in self.accepted)]
        parts += [f"above {self.above:g}"] if math.isfinite(self.above) else []
        parts += [f"below {self.below:g}"] if math.isfinite(self.below) else []
        return " and ".join(p for p in parts if p)
