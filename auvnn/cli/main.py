"""The `auvnn` command: pops the verb and runs that verb's Hydra application."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from auvnn.catalogue import unknown_name
from auvnn.cli.faults import INTERRUPTED, OK, TERMINATED, Terminated, outcome
from auvnn.cli.pages import PAGES
from auvnn.cli.speech import complain
from auvnn.cli.verbs import VERBS
from auvnn.errors import ConfigError
from auvnn.executors.safe_path import keep_safe
from auvnn.threads import sleep_when_idle


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `auvnn` with its arguments, those of the process by default, and return the exit status."""
    verb, *rest = [*(sys.argv[1:] if arguments is None else arguments)] or ["--help"]
    label = "auvnn" if verb.startswith("-") else f"auvnn {verb}"
    statuses: list[int] = []
    _prepare()
    try:
        ended = outcome(label, lambda: statuses.append(_dispatch(verb, rest)))
    except KeyboardInterrupt as end:
        asked = isinstance(end, Terminated)
        how = "ended on request" if asked else "interrupted"
        complain(f"{label}: {how}; {end or 'what was unfinished has been taken away'}")
        return TERMINATED if asked else INTERRUPTED
    return ended or statuses[0]


def _dispatch(verb: str, rest: list[str]) -> int:
    if verb in ("help", "--help", "-h") and rest and rest[0] in VERBS:
        # `auvnn help compare` means `auvnn compare --help`.
        verb, rest = rest[0], ["--help"]
    if verb in ("--help", "-h", "help", "--version", "-V", "version"):
        from auvnn import __version__
        from auvnn.cli.overview import overview

        print(f"auvnn {__version__}" if verb in ("--version", "-V", "version") else overview())
        return OK
    if verb in PAGES:
        print(PAGES[verb](rest))
        return OK
    if verb not in VERBS:
        # What is no verb of a model or a log can be meant too: `verson` is `version`.
        raise ConfigError(unknown_name("verb", verb, [*VERBS.names(), *PAGES, "version", "help"]))
    found = VERBS.get(verb)
    from auvnn.cli.runs.application import run_verb

    return run_verb(verb, found, rest)


def _prepare() -> None:
    """Let SIGTERM end a run as Ctrl-C does, import nothing from here, print every character, keep libraries quiet."""
    keep_safe()
    sleep_when_idle()

    def end(_signal: int, _frame: Any) -> None:
        raise Terminated

    with contextlib.suppress(ValueError):  # signals are heard in the main thread alone
        signal.signal(signal.SIGTERM, end)
    if not sys.warnoptions and os.environ.get("AUVNN_DEBUG") != "1":
        # What a user should know stands in the answer; a library's notes to programmers are not for users.
        warnings.simplefilter("ignore")
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="replace")


__all__ = ["VERBS", "main"]
