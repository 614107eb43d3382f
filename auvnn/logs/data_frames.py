"""Logs from tables in memory and back: pandas, polars, or arrays by name."""

from __future__ import annotations

from collections.abc import Mapping as MappingType
from typing import TYPE_CHECKING, Any

import numpy as np

from auvnn.errors import InputError, MissingExtra, one_line
from auvnn.logs.readers.base import Table
from auvnn.logs.readers.frame import clean_names, to_table
from auvnn.logs.reading.mapping_file.mapping import Mapping

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl

    from auvnn.logs.log import Log
    from auvnn.logs.reading.reading import Reading


def from_dataframe(data: Any, mapping: Any = None, name: str = "data frame") -> Reading:
    """Return what a log is made of: a table in memory, treated as a file of the same columns would be.

    Args:
        data: a pandas or polars data frame, or a dict of arrays (N,); pandas' index is taken as a column if it
            has a name, or as `t` if it holds times and there is no `t`.
        mapping: a mapping file's path or its content as a dict; None for canonical columns.
        name: of the log.

    Raises:
        InputError: it is no table, or its content must not be trusted.
        ConfigError: the mapping is wrong.
    """
    from pathlib import Path

    from auvnn.logs.reading.reading import Collector, Reading, collect

    plan = Mapping.read(mapping)
    collector = Collector()
    with np.errstate(all="ignore"):
        table = plan.apply(_table(data, name), name)
        collector.repairs.extend(table.repairs)
        collect(table, plan, Path(name), collector)
    return Reading(
        tuple(collector.runs), name, (), tuple(collector.repairs), "", tuple(collector.unknown), ()
    )


def _table(data: Any, where: str) -> Table:
    import polars as pl

    module = type(data).__module__.split(".")[0]
    if module == "pandas":
        data = _pandas_columns(data, where)
    if isinstance(data, pl.LazyFrame):
        data = data.collect()
    if isinstance(data, MappingType):
        data = _frame_of(data, where)
    if not isinstance(data, pl.DataFrame):
        raise InputError(f"{where}: a log is made of a pandas or polars data frame or a dict of arrays, not of a "
                         f"{type(data).__name__}")  # fmt: skip
    if data.height == 0:
        raise InputError(f"{where}: has no rows")
    names, notes = clean_names([str(n) for n in data.columns], where)
    frame = data.clone()
    frame.columns = names
    table = to_table(frame, where)
    table.repairs[:0] = notes
    return table


def _pandas_columns(data: Any, where: str) -> dict[str, np.ndarray]:
    if not hasattr(data, "columns"):
        raise InputError(f"{where}: a pandas {type(data).__name__} is no table; make it a DataFrame")
    if getattr(data.columns, "nlevels", 1) > 1:
        raise InputError(f"{where}: has columns of several levels; flatten their names first")
    twice = sorted({str(n) for n in data.columns[data.columns.duplicated()]})
    if twice:
        raise InputError(
            f"{where}: the columns {', '.join(map(repr, twice))} occur twice; rename one of each"
        )
    columns: dict[str, np.ndarray] = {}
    index = data.index
    if index.name is not None and str(index.name) not in map(str, data.columns):
        columns[str(index.name)] = index.to_numpy()
    elif index.dtype.kind in "Mmf" and "t" not in data.columns:
        columns["t"] = index.to_numpy()
    for name in data.columns:
        column = data[name]
        numbers = column.dtype.kind in "iufb" if isinstance(column.dtype, np.dtype) else False
        extension = not isinstance(column.dtype, np.dtype) and getattr(column.dtype, "_is_numeric", False)
        columns[str(name)] = (
            column.to_numpy() if numbers else column.to_numpy(dtype=np.float64, na_value=np.nan) if extension
            else _stamps(column) if getattr(column.dtype, "kind", "O") in "Mm" else column.astype(object).to_numpy()
        )  # fmt: skip
    return columns


def _stamps(column: Any) -> np.ndarray:
    plain = column.dt.tz_localize(None) if getattr(column.dtype, "tz", None) is not None else column
    return plain.to_numpy()


def _frame_of(data: MappingType[Any, Any], where: str) -> pl.DataFrame:
    import polars as pl

    columns: dict[str, Any] = {}
    for name, values in data.items():
        array = np.asarray(values.detach().cpu() if hasattr(values, "detach") else values)
        if array.ndim != 1:
            raise InputError(f"{where}: '{name}' has shape {array.shape}; a column is an array (N,)")
        if array.dtype.kind == "O":
            columns[str(name)] = pl.Series(
                str(name), [None if _missing(v) else v for v in array.tolist()], strict=False
            )
        elif array.dtype.kind == "M":
            columns[str(name)] = array.astype("datetime64[ns]")
        elif array.dtype.kind == "m":
            columns[str(name)] = array.astype("timedelta64[ns]")
        elif array.dtype.kind in "iufbU":
            columns[str(name)] = array
        else:
            raise InputError(f"{where}: '{name}' holds {array.dtype}, which is no number")
    sizes = {name: len(column) for name, column in columns.items()}
    if len(set(sizes.values())) > 1:
        short, long = min(sizes, key=lambda n: sizes[n]), max(sizes, key=lambda n: sizes[n])
        raise InputError(
            f"{where}: '{short}' has {sizes[short]} rows and '{long}' {sizes[long]}: columns must be as long"
        )
    try:
        return pl.DataFrame(columns, nan_to_null=False)
    except (pl.exceptions.PolarsError, TypeError, ValueError) as problem:
        raise InputError(f"{where}: is no table of numbers: {one_line(problem, 200)}") from None


def _missing(value: Any) -> bool:
    return value is None or value != value or type(value).__name__ in ("NAType", "NaTType")


def to_polars(log: Log) -> pl.DataFrame:
    """Return the log as one table, `run` first, then the canonical columns; NaN is missing."""
    from auvnn.logs.writing import to_frame

    return to_frame(log)


def to_pandas(log: Log) -> pd.DataFrame:
    """Return the log as one table, `run` first, then the canonical columns; NaN is missing.

    Raises:
        MissingExtra: pandas is not there.
    """
    try:
        import pandas as pd
    except ImportError:
        raise MissingExtra("pandas", "pandas", "a pandas data frame") from None
    frame = to_polars(log)
    return pd.DataFrame({name: frame[name].to_numpy() for name in frame.columns})
