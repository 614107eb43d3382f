"""How a run ends: an exit status, and one line on standard error when it did not end well."""

from __future__ import annotations

import errno
import os
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path

from auvnn.answers import write_text
from auvnn.cli.runs.working import WORK, marked
from auvnn.cli.speech import complain
from auvnn.errors import AuvnnError, ConfigError, one_line

OK, FAULT, BAD_INPUT, INTERRUPTED, UNHEARD, TERMINATED = 0, 1, 2, 130, 141, 143

# What the user's own disk or path can do to us; any other OSError is ours to fix.
_USERS = {
    errno.EACCES, errno.EDQUOT, errno.EEXIST, errno.EFBIG, errno.EIO, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG,
    errno.ENOENT, errno.ENOSPC, errno.ENOTDIR, errno.EPERM, errno.EROFS,
}  # fmt: skip


class Terminated(KeyboardInterrupt):
    """The process was asked to end."""


def outcome(label: str, call: Callable[[], None], out: Path | None = None) -> int:
    """Run a call, turn what it raises into one line, and return the exit status.

    Args:
        label: what the line begins with.
        call: what to do.
        out: folder of the run, under which the trace of a fault is kept.
    """
    try:
        call()
    except BrokenPipeError:
        # Whoever read our lines has gone; without this Python complains once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UNHEARD
    except AuvnnError as error:
        complain(f"{label}: {error}")
        _trace_if_asked()
        return BAD_INPUT
    except OSError as error:
        if error.errno in _USERS:
            complain(f"{label}: {error.filename or out or 'a file'}: {os.strerror(error.errno or 0)}")
            _trace_if_asked()
            return BAD_INPUT
        return _fault(label, error, out)
    except Exception as error:
        return _fault(label, error, out)
    return OK


def _fault(label: str, error: Exception, out: Path | None) -> int:
    place = "above" if _trace_if_asked() else f"in {_keep_trace(out)}"
    what = f"{type(error).__name__}: {one_line(error, 300)}"
    complain(f"{label}: a fault of the program, not of your input ({what}); the trace is {place}")
    return FAULT


def _trace_if_asked() -> bool:
    asked = os.environ.get("AUVNN_DEBUG") == "1"
    if asked:
        traceback.print_exc(file=sys.stderr)
    return asked


def _keep_trace(out: Path | None) -> Path:
    try:
        if out is None:
            raise ConfigError("nothing is to be written")
        marked(out)
        return write_text(out / WORK / "fault.txt", traceback.format_exc())
    except (OSError, ConfigError):
        return write_text(Path(tempfile.mkdtemp(prefix="auvnn-")) / "fault.txt", traceback.format_exc())
