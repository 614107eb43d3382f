"""Unpacking compressed blocks from files that are not trusted: never more than a limit."""

from __future__ import annotations

import bz2
import zlib

from auvnn.errors import InputError, MissingExtra

LIMIT = 256_000_000
"""Bytes that one block may have when unpacked; recorders write blocks of a few megabytes."""


def unpack(method: str, data: bytes, size: int, where: str, limit: int = LIMIT) -> bytes:
    """Return a block unpacked.

    Args:
        method: "", "zstd", "lz4", "bz2" or "zlib".
        data: packed.
        size: that it claims to have when unpacked; -1 where it does not say.
        where: for messages.
        limit: bytes.

    Raises:
        InputError: damaged, larger than the limit, or an unknown method.
        MissingExtra: the package that unpacks it is missing.
    """
    if size > limit:
        raise InputError(f"{where}: a block claims {size / 1e9:.1f} GB: damaged")
    bound = size if size >= 0 else limit
    try:
        if method == "":
            out = data
        elif method == "zstd":
            import zstandard

            out = _some(zstandard.ZstdDecompressor(max_window_size=2**27).decompressobj(), data, bound)
        elif method == "lz4":
            import lz4.frame

            out = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=bound + 1)
        elif method in ("bz2", "zlib"):
            worker = bz2.BZ2Decompressor() if method == "bz2" else zlib.decompressobj()
            out = worker.decompress(data, bound + 1)
        else:
            raise InputError(f"{where}: is compressed by '{method[:20]}', which is not known")
    except ImportError:
        package = {"zstd": "zstandard"}.get(method, method)
        raise MissingExtra(package, "ros", f"unpacking {method}") from None
    except InputError:
        raise
    except Exception as problem:
        raise InputError(f"{where}: a packed block is damaged ({type(problem).__name__})") from None
    if len(out) > bound or (size >= 0 and len(out) != size):
        raise InputError(f"{where}: a packed block has another size than it claims: damaged")
    return out


def _some(worker: object, data: bytes, bound: int) -> bytes:
    out = bytearray()
    for at in range(0, len(data), 16_384):
        out += worker.decompress(data[at : at + 16_384])  # type: ignore[attr-defined]
        if len(out) > bound:
            break
    return bytes(out)
