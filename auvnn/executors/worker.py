"""The other end of `executors.processes`: takes a function, then one task after the other, until nobody asks."""

from __future__ import annotations

import pickle
import sys
from multiprocessing.connection import Connection
from typing import Any

from auvnn.executors.packing import pack, sendable


def serve(end: Connection) -> None:
    """Answer tasks until the other end closes."""
    function: Any = None
    shared: Any = None
    while True:
        try:
            what, *rest = pickle.loads(end.recv_bytes())
        except (EOFError, OSError):
            return
        if what == "job":
            function, shared = rest
            continue
        try:
            answer = pack(("value", function(shared, rest[0])))
        except Exception as error:
            answer = pack(("error", sendable(error)))
        try:
            end.send_bytes(answer)
        except OSError:
            return


if __name__ == "__main__":
    # What a library prints must not get into the answer of whoever started us.
    sys.stdout = sys.stderr
    serve(Connection(int(sys.argv[1])))
