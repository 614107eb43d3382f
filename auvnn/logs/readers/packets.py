"""Finding packets in a stream of bytes in which some may be lost or damaged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Rows = NDArray[np.int64]


def chain(starts: Rows, lengths: Rows, end: int, first: int = 0) -> tuple[Rows, int, int]:
    """Return which of the places that look like a packet's start are one, by following packets from one to the next.

    Where a packet is not followed by another, the reading goes on at the next place that looks like one.

    Args:
        starts: places that look like a start, increasing, (N,).
        lengths: of the packet that each would be, (N,).
        end: number of bytes.
        first: where the first packet is expected.

    Returns:
        Indices of the accepted starts, the number of bytes that belong to none, and how often packets were lost.
    """
    if not len(starts):
        return np.zeros(0, np.int64), end - first, int(end > first)
    stops = starts + lengths
    following = np.searchsorted(starts, stops)
    exact = (following < len(starts)) & (starts[np.minimum(following, len(starts) - 1)] == stops)
    at_end = stops == end
    whole = stops <= end
    # Whoever is followed by another packet, or by the end, is one; others only if nothing better comes before their end.
    good = (exact | at_end) & whole
    # Plain lists are quicker to follow one by one than arrays.
    step, fine, fits, begin = following.tolist(), good.tolist(), whole.tolist(), starts.tolist()
    taken: list[int] = []
    lost = begin[0] - first
    breaks = int(lost > 0)
    i, count = 0, len(begin)
    stop = stops.tolist()
    while i < count:
        if fine[i]:
            taken.append(i)
            i = step[i]
            continue
        if fits[i] and taken and stop[taken[-1]] == begin[i]:
            # It begins where one ended, but nothing follows: the bytes after it are damaged, or it is damaged itself.
            k = i + 1
            while k < count and begin[k] < stop[i] and not fine[k]:
                k += 1
            if k >= count or begin[k] >= stop[i]:
                taken.append(i)
                after = stop[i]
            else:
                after = begin[i]
            lost += (begin[k] if k < count else end) - after
            breaks += 1
            i = k
            continue
        k = i + 1
        while k < count and not fine[k]:
            k += 1
        before = stop[taken[-1]] if taken and stop[taken[-1]] <= begin[i] else begin[i]
        lost += (begin[k] if k < count else end) - before
        breaks += 1
        i = k
    return np.array(taken, dtype=np.int64), int(lost), breaks


def columns(data: Bytes, starts: Rows, record: np.dtype) -> NDArray:
    """Return the records that begin at these places, as a structured array (N,).

    Args:
        data: bytes of the file, (M,).
        starts: places at which the records begin, (N,).
        record: layout of one record.
    """
    size = record.itemsize
    if not len(starts):
        return np.zeros(0, record)
    out = np.empty((len(starts), size), np.uint8)
    block = max(1, 4_000_000 // size)
    reach = np.arange(size)
    for at in range(0, len(starts), block):
        part = starts[at : at + block]
        out[at : at + len(part)] = data[part[:, None] + reach]
    return out.view(record)[:, 0]
