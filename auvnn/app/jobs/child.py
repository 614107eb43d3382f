"""The child process from the server's side: one job at a time, told in words how it goes, stopped at any moment."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from auvnn.app.jobs.messages import Order, Report
from auvnn.errors import AuvnnError


class Child:
    """A worker process that is started when it is first needed, and started again after a stop.

    Orders and reports are lines of JSON. The process ends when its standard input closes, so that nothing
    goes on working for a server that was killed.

    Args:
        folder: for what the process says to nobody (`worker.log`).
        hear: called with each report, from a separate thread.
    """

    def __init__(self, folder: Path, hear: Callable[[Report], None]) -> None:
        self.folder = folder
        self.hear = hear
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._closed = False

    def warm(self) -> None:
        """Start the process, so that it has loaded what it needs when the first order comes."""
        with self._lock:
            if not self._closed:
                self._started()

    def order(self, order: Order) -> None:
        """Send an order.

        Raises:
            AuvnnError: the process cannot be reached.
        """
        with self._lock:
            if self._closed:
                raise AuvnnError("the page is being closed: start auvnn app again")
            process = self._started()
            assert process.stdin is not None
            try:
                process.stdin.write(json.dumps(order) + "\n")
                process.stdin.flush()
            except OSError as problem:
                self._process = None
                raise AuvnnError(
                    f"the worker process has ended ({problem}); press the button again"
                ) from None

    def skip(self, number: int) -> bool:
        """Ask the process to leave a job out that it has not begun; False where it cannot be asked.

        Args:
            number: of the job.
        """
        process = self._process
        if process is None or process.poll() is not None or process.stdin is None:
            return False
        with self._lock, contextlib.suppress(OSError, ValueError):
            process.stdin.write(json.dumps({"skip": number}) + "\n")
            process.stdin.flush()
            return True
        return False

    def stop(self) -> None:
        """End the process at once; whatever it was writing stays beside its place and is never moved there."""
        with self._lock:
            process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(OSError):
                process.kill()
            process.wait()

    @property
    def alive(self) -> bool:
        """Whether the process is there."""
        process = self._process
        return process is not None and process.poll() is None

    def close(self) -> None:
        """End the process for good."""
        with self._lock:
            self._closed = True
        self.stop()

    def _started(self) -> subprocess.Popen[str]:
        if self._process is not None and self._process.poll() is None:
            return self._process
        environment = dict(os.environ)
        # The page goes on being served meanwhile: one core is for it.
        environment.setdefault("OMP_NUM_THREADS", "1")
        environment["PYTHONPATH"] = os.pathsep.join(p or os.getcwd() for p in sys.path)
        with (self.folder / "worker.log").open("a", encoding="utf-8") as said:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "auvnn.app.jobs.worker"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=said,
                env=environment, text=True, encoding="utf-8", start_new_session=True,
            )  # fmt: skip
        threading.Thread(target=self._listen, args=(self._process,), daemon=True).start()
        return self._process

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with contextlib.suppress(ValueError, OSError):
            for line in process.stdout:
                with contextlib.suppress(json.JSONDecodeError):
                    self.hear(json.loads(line))
        status = process.wait()
        if self._process is process:
            self.hear({"ended": status})
