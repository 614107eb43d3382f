"""The child process that does what takes long: orders in, reports out, by lines of JSON."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import sys
import threading
import warnings
from typing import Any

from auvnn.app.jobs.messages import Order
from auvnn.errors import AuvnnError, one_line


def main() -> None:
    """Take orders until standard input closes."""
    # Reports have a separate channel: what a library prints must not get between them.
    channel = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    lock = threading.Lock()

    def report(**words: Any) -> None:
        with lock, contextlib.suppress(OSError):
            channel.write(json.dumps(words, allow_nan=False) + "\n")
            channel.flush()

    orders: queue.Queue[Order] = queue.Queue()

    begun, skipped, turn = 0, set[int](), threading.Lock()

    def listen() -> None:
        for line in sys.stdin:
            order = json.loads(line)
            if "skip" not in order:
                orders.put(order)
                continue
            with turn:
                skipped.add(order["skip"])
                # A job that has begun ends only with this process; one that has not is left out.
                report(job=order["skip"], left_out=begun < order["skip"])
        # The server is gone: nobody waits for what is being done.
        os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    warnings.simplefilter("ignore")
    from auvnn.app.jobs.tasks import Tasks

    tasks = Tasks()
    while True:
        try:
            order = orders.get(timeout=0.2)
        except queue.Empty:
            # Reports are drawn while nobody waits for anything.
            for drawn, problem in tasks.draw_one():
                report(drawn=drawn, problem=problem)
            continue
        number = order["job"]
        try:
            for drawn, problem in tasks.draw_all():
                report(drawn=drawn, problem=problem)
            with turn:
                if number in skipped:
                    continue
                begun = number
            summary = tasks.do(
                order, lambda words, job=number: report(job=job, progress=one_line(words, 200))
            )
            report(job=number, done=summary)
        except AuvnnError as error:
            report(job=number, error=one_line(error))
        except Exception as error:
            import traceback

            traceback.print_exc()
            words = (
                f"a fault of the program, not of your input ({type(error).__name__}: {one_line(error, 300)})"
            )
            report(job=number, error=words, fault=True)


if __name__ == "__main__":
    main()
