"""Estimators that run as several cores of which one is in use: its values are taken, and a switch starts again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.errors import InputError
from auvnn.logs.channels import RESET
from auvnn.logs.readers.base import Table
from auvnn.logs.reading.repairs.repair import Repair


def rows_of_primary(table: Table, core: str, primary: str, where: str, mapping: str) -> Table:
    """Return the rows of the core that is in use, of a table in which each core has separate rows.

    Args:
        table: columns under the file's names.
        core: column that holds the row's core.
        primary: column that holds the core in use; missing cells repeat the one before.
        where: file, for messages.
        mapping: the mapping's file, for messages.

    Raises:
        InputError: one of the columns is not there or no number, or no row is of the core in use.
    """
    for name in (core, primary):
        if name not in table.columns:
            raise InputError(
                f"{where}: {mapping} follows the core by a column of numbers that is not there: "
                f"{unknown_name('column', name, list(table.columns))}"
            )
    used = _held(table.columns[primary].astype(np.float64))
    keep = table.columns[core].astype(np.float64) == used
    if not keep.any():
        raise InputError(f"{where}: no row has '{core}' equal to '{primary}': check core in {mapping}")
    repairs = list(table.repairs)
    left = int((~keep).sum())
    if left:
        words = f"rows of other cores than the one in use ('{primary}') left out"
        repairs.append(Repair(words, where, left))
    columns = {n: c[keep] for n, c in table.columns.items()}
    columns[primary] = used[keep]
    rows = int(keep.sum())
    text = {}
    for name, words in table.text.items():
        text[name] = type(words)(words.bad, None if words.codes is None else words.codes[keep], words.labels)
    picked = Table(columns, rows, text, set(table.seconds), repairs)
    _note(picked, used[keep], primary, where)
    return picked


def chosen(
    each: Sequence[NDArray[Any]], by: NDArray[Any], name: str, source: str, where: str
) -> NDArray[np.float64]:
    """Return in each row the value of the core in use, NaN where no such core was given.

    Args:
        each: (N,) of core 0, 1, ...
        by: (N,) number of the core in use; missing cells repeat the one before.
        name: canonical column, for messages.
        source: column that holds the core in use, for messages.
        where: file, for messages.

    Raises:
        InputError: the core in use is no whole number or one that is not listed.
    """
    used = _held(by.astype(np.float64))
    present = used[np.isfinite(used)]
    beyond = present[(present < 0) | (present >= len(each)) | (present != np.round(present))]
    if len(beyond):
        raise InputError(
            f"{where}: '{name}' has columns for the cores 0 to {len(each) - 1}, but '{source}' says "
            f"{beyond[0]:g}: list one column for each core"
        )
    index = np.where(np.isfinite(used), used, 0).astype(int)
    values = np.stack([c.astype(np.float64) for c in each])[index, np.arange(len(used))]
    return np.where(np.isfinite(used), values, np.nan)


def note_switches(table: Table, by: NDArray[Any], source: str, where: str) -> None:
    """Keep the core in use as the column `reset`, once, and count its switches.

    Args:
        table: that is changed.
        by: number of the core in use, (N,).
        source: of these numbers, for messages.
        where: of the file, for messages.
    """
    if RESET not in table.columns:
        used = _held(by.astype(np.float64))
        table.columns[RESET] = used
        _note(table, used, source, where)


def _note(table: Table, used: NDArray[np.float64], source: str, where: str) -> None:
    switches = int((np.diff(used[np.isfinite(used)]) != 0).sum())
    if switches:
        words = f"switches of the estimator's core in use ('{source}') followed"
        table.repairs.append(Repair(words, where, switches))


def _held(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values with missing ones repeating the last before them."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return values[last]
