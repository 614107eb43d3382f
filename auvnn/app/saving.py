"""What the user takes home: the model, the report, the logs, and what does the same without the page."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from pathlib import Path

from auvnn.answers import write_text
from auvnn.app.script import Told, commands, python
from auvnn.app.session import Session
from auvnn.errors import ConfigError, InputError

PATIENCE = 600.0  # s, for reports to be drawn
GONE = "the worker process ended before it was drawn; run the step again to have it"
ANSWERS = ("comparison", "diagnosis", "improvement", "improve")


def save(session: Session, folder: Path) -> tuple[list[str], list[str]]:
    """Write everything into a folder that is new or empty; return what it holds then, and what could not be drawn.

    `model/` (where effects were kept), `log.parquet` and `test.parquet`, the answers with their reports, `commands.sh`
    and `loop.py`. It is staged beside its place and moved there: either all of it is there, or nothing. Reports that
    are being drawn are waited for; nothing else is begun meanwhile.

    Args:
        session: what was done.
        folder: where to.

    Raises:
        ConfigError: the folder holds something, or there is nothing to save.
        InputError: it cannot be written to, or the reports are not drawn in time.
    """
    folder = folder.expanduser().absolute()
    told = session.told()
    with session.lock:
        session.refuse_busy()
        session.saving = True
    try:
        return _saved(session, folder, told)
    finally:
        with session.lock:
            session.saving = False


def _saved(session: Session, folder: Path, told: Told) -> tuple[list[str], list[str]]:
    with session.lock:
        source, history, answers = session.source, list(session.history), dict(session.answers)
    assert source is not None and source.fit is not None
    last = history[-1]
    # The report of the model that is saved, not of a later try that was not kept.
    wanted = {
        k: last.answer if k == last.kind and last.answer is not None else answers.get(k) for k in ANSWERS
    }
    places = {kind: place for kind, place in wanted.items() if place is not None}
    missing = _drawn(session, places)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{folder}: is not empty; choose a new folder")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    except OSError as problem:
        raise InputError(f"{folder}: cannot be written ({os.strerror(problem.errno or 0)})") from None
    try:
        if history[-1].answer is not None:
            shutil.copytree(history[-1].source, stage / "model")
        source.fit.write(stage / "log.parquet")
        if source.held is not None:
            source.held.write(stage / "test.parquet")
        for kind, place in places.items():
            shutil.copy(place / f"{kind}.json", stage / f"{kind}.json")
            if kind not in missing:
                # `report.html` is that of the saved model; where none was kept, that of the last fit.
                main = last.kind if last.answer is not None else "improvement"
                name = "report.html" if kind == main else f"{kind}.html"
                shutil.copy(place / "report.html", stage / name)
        write_text(stage / "loop.py", python(told))
        write_text(stage / "commands.sh", commands(told, folder))
        os.chmod(stage, 0o755)
        if folder.is_dir():
            folder.rmdir()
        stage.rename(folder)
    except OSError as problem:
        raise InputError(f"{folder}: cannot be written ({problem.strerror})") from None
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    held = sorted(entry.name + "/" * entry.is_dir() for entry in folder.iterdir())
    without = [f"the report of the {kind} is not there: {why}" for kind, why in missing.items()]
    with session.lock:
        session.saved.append(str(folder))
        session.saved_without = without
        session.version += 1
    return held, without


def _drawn(session: Session, places: dict[str, Path]) -> dict[str, str]:
    """Wait until the child process, which has nothing else to do now, has drawn the reports.

    Args:
        session: what was done.
        places: folder of each answer, by its kind.

    Returns:
        Why a report will never be there, by the kind of its answer.

    Raises:
        InputError: it takes too long.
    """
    end = time.monotonic() + PATIENCE
    while True:
        # Asked first: what the child drew before it ended is there.
        alive = session.child.alive
        left = {kind: place for kind, place in places.items() if not (place / "report.html").is_file()}
        missing = {kind: session.undrawn[str(p)] for kind, p in left.items() if str(p) in session.undrawn}
        if len(missing) == len(left):
            return missing
        if not alive:
            return {kind: missing.get(kind, GONE) for kind in left}
        if time.monotonic() >= end:
            raise InputError(
                f"the reports are still being drawn after {PATIENCE:.0f} s, nothing was saved; press Save again"
            )
        time.sleep(0.1)


def proposed(session: Session) -> Path:
    """Return a folder that is free to save into."""
    names = [session.out, *(session.out.with_name(f"{session.out.name}_{n}") for n in range(2, 1000))]
    return next(p for p in names if not p.exists() or (p.is_dir() and not any(p.iterdir())))
