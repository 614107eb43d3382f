"""Files damaged at random: bytes changed, put in, taken out, repeated, cut; and what reading them costs."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from auvnn.errors import AuvnnError
from auvnn.logs import Log
from tests.log_samples import make_run
from tests.logs.foreign_formats import FORMATS, alog

SAMPLES = {name: (file, writer) for name, (file, writer, _) in FORMATS.items()} | {"alog": ("log.alog", alog)}
_NUMBERS = [
    b"\xff" * 4,
    b"\xff" * 8,
    b"\x00" * 4,
    b"\x7f\xff\xff\xff",
    b"\xff\xff\xff\x7f",
    b"\x00\x00\x00\x80",
]


def mutate(content: bytes, random: np.random.Generator) -> bytes:
    """Return damaged bytes: one to eight changes, half of them near the beginning, where lengths and layouts stand."""
    data = bytearray(content)
    for _ in range(int(random.integers(1, 9))):
        reach = len(data) if random.random() < 0.5 else min(len(data), 600)
        at = int(random.integers(0, max(reach, 1)))
        kind = random.integers(0, 7)
        if kind == 0 and len(data):
            at = min(at, len(data) - 1)
            data[at] ^= 1 << int(random.integers(0, 8))
        elif kind == 1:
            data[at : at + 4] = random.bytes(4)
        elif kind == 2:
            data[at:at] = random.bytes(int(random.integers(1, 40)))
        elif kind == 3:
            del data[at : at + int(random.integers(1, 200))]
        elif kind == 4 and random.random() < 0.3:
            del data[at:]
        elif kind == 5:
            data[at:at] = data[at : at + int(random.integers(1, 3000))]
        else:
            number = _NUMBERS[int(random.integers(0, len(_NUMBERS)))]
            data[at : at + len(number)] = number
    return bytes(data)


def read_all(name: str, count: int, seed: int = 0) -> tuple[float, float, int]:
    """Read damaged files of one format.

    Returns:
        The longest time of a file, s; the largest memory of this process, bytes; the number that was read anyway.
    """
    import resource

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        file, writer = SAMPLES[name]
        good = writer(Log.from_runs([make_run(60)]), folder / file)
        content = good.read_bytes()
        random = np.random.default_rng([seed, len(name)])
        path = folder / f"damaged{good.suffix if not good.name.endswith('.lsf.gz') else '.lsf.gz'}"
        longest, read = 0.0, 0
        for _ in range(count):
            path.write_bytes(mutate(content, random))
            start = time.perf_counter()
            try:
                log = Log.read(path)
            except AuvnnError as problem:
                assert "\n" not in str(problem), problem
                assert len(str(problem)) < 3000, problem
            else:
                read += 1
                log.quality().to_dict()
            longest = max(longest, time.perf_counter() - start)
        used = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return longest, used, read


if __name__ == "__main__":
    print(*read_all(sys.argv[1], int(sys.argv[2]), int(sys.argv[3])))
