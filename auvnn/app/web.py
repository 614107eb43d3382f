"""The addresses of the page: its files, and one small answer for each thing that it asks."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from auvnn.app import saving
from auvnn.app.answering import Asked, answering, refused, said, span
from auvnn.app.cures import changed, offered
from auvnn.app.guard import REPORT_POLICY
from auvnn.app.logview import traces
from auvnn.app.script import commands, python
from auvnn.app.session import Session
from auvnn.app.source import Source
from auvnn.errors import ConfigError, InputError
from auvnn.vehicle.library import builtin_vehicles

STATIC = Path(__file__).parent / "static"


class Pages:
    """Answers of the page's addresses.

    Args:
        session: what they belong to.
    """

    def __init__(self, session: Session) -> None:
        self.session = session

    def app(self) -> Starlette:
        """Return the application."""
        gets: dict[str, Callable[[Asked], Any]] = {
            "state": lambda asked: self.session.state(),
            "log": self.log,
            "findings": self.findings,
            "traces": self.traces,
            "vehicles": lambda asked: builtin_vehicles(),
            "answer": lambda asked: self.session.answer(str(asked.get("kind"))),
            "where": lambda asked: self.where().map(),
            "where-traces": lambda asked: self.where().traces(*span(asked)),
            "where-marks": lambda asked: self.where().marks(
                str(asked.get("regime")), int(asked.get("bin", -1))
            ),
            "held-traces": self.held_traces,
            "effects": self.effects,
            "script": self.script,
        }
        posts: dict[str, Callable[[Asked], Any]] = {
            "open": self.open, "mapping": self.mapping, "model": self.model, "held": self.held,
            "start": self.start, "stop": lambda asked: self.session.stop(), "try": self.attempt,
            "keep": lambda asked: self.session.keep(str(asked.get("kind", "improvement"))),
            "take-back": lambda asked: self.session.take_back(),
            "save": self.save,
        }  # fmt: skip
        routes = [Route("/", _page), Route("/api/upload", self.upload, methods=["PUT"])]
        routes += [Route(f"/api/{name}", answering(call)) for name, call in gets.items()]
        routes += [Route(f"/api/{name}", answering(call), methods=["POST"]) for name, call in posts.items()]
        routes += [Route("/report/{kind}", self.report), Mount("/static", StaticFiles(directory=STATIC))]
        return Starlette(routes=routes)

    def log(self, asked: Asked) -> Any:
        """Columns, mapping and extent of the log."""
        source = self._source()
        names = [str(c["name"]) for c in source.raw]
        return {
            **source.described(),
            "error": source.error,
            "offered": offered(source.error, source.mapping, names),
        }

    def findings(self, asked: Asked) -> Any:
        """Findings of the quality report, null until they are there."""
        return self._source().findings

    def traces(self, asked: Asked) -> Any:
        """Traces of one group of channels."""
        number, low, high, points = span(asked)
        log = self._source().log
        if log is None:
            raise ConfigError("there is no log that could be drawn")
        self.session.looked.set()
        return traces(log, number, str(asked.get("group", "velocity")), low, high, points)

    async def upload(self, request: Request) -> Response:
        """Take a file that was dropped on the page: a log, a held-out log, or a model's YAML file."""
        name = (
            re.sub(r"[^\w.+-]", "_", Path(request.query_params.get("name", "log")).name)[-120:].lstrip(".")
            or "log"
        )
        folder = Path(tempfile.mkdtemp(dir=self.session.work))
        path, beside = folder / name, folder / ".part"
        try:
            with beside.open("wb") as stream:
                async for chunk in request.stream():
                    await run_in_threadpool(stream.write, chunk)
            beside.rename(path)
        except OSError as problem:
            return refused(f"{name}: cannot be kept ({os.strerror(problem.errno or 0)})")
        use = request.query_params.get("use", "log")
        return await run_in_threadpool(said, self._use, {"use": use, "path": str(path)})

    def open(self, asked: Asked) -> Any:
        """Open a file of this machine by its path."""
        path = Path(str(asked.get("path", ""))).expanduser()
        if not path.exists():
            raise InputError(f"{path}: there is no such file; check the path")
        return self._use({"use": asked.get("use", "log"), "path": str(path)})

    def _use(self, asked: Asked) -> Any:
        path, old = Path(asked["path"]), self.session.source
        if asked["use"] == "model":
            self.session.choose_model(str(path))
        elif asked["use"] == "held":
            source = self._source()
            self._open(Source(source.files, source.mapping, source.max_duration, [path]))
        elif asked["use"] == "log":
            # The next file of the same vehicle is most likely recorded in the same way.
            mapping = old.mapping if old is not None and old.log is not None else {}
            self._open(Source([path], mapping))
        else:
            raise ConfigError(f"use={asked['use']}: a file is used as log, held or model")
        return self.session.state()

    def mapping(self, asked: Asked) -> Any:
        """Read the log again: with a whole mapping, or with the change that a cure makes."""
        source = self._source()
        mapping = changed(source.mapping, asked["change"]) if "change" in asked else asked.get("mapping")
        if not isinstance(mapping, dict):
            raise ConfigError("a mapping is `key: value` lines")
        self._open(Source(source.files, mapping, source.max_duration, source.test))
        return self.session.state()

    def held(self, asked: Asked) -> Any:
        """Go back to holding out the last run, or the last 30 % of a single one."""
        source = self._source()
        self._open(Source(source.files, source.mapping, source.max_duration))
        return self.session.state()

    def _open(self, source: Source) -> None:
        self.session.open(source)

    def _source(self) -> Source:
        source = self.session.source
        if source is None:
            raise ConfigError("there is no log yet: drop a file, or choose one")
        return source

    def model(self, asked: Asked) -> Any:
        """Choose a built-in vehicle, or a model by its path."""
        self.session.choose_model(os.path.expanduser(str(asked.get("source", ""))))
        return self.session.state()

    def start(self, asked: Asked) -> Any:
        """Start a job."""
        effects = [str(e) for e in asked.get("effects") or []]
        self.session.start(str(asked.get("kind")), effects, asked.get("force") is True)
        return self.session.state()

    def where(self) -> Any:
        """The comparison, read back once."""
        from auvnn.app.where import Where

        with self.session.lock:
            folder, source = self.session.answers.get("comparison"), self.session.source
            if folder is None or source is None or source.fit is None:
                raise ConfigError("model and log have not been compared yet")
            if "comparison" not in self.session.views:
                self.session.views["comparison"] = Where(folder, source.fit)
            return self.session.views["comparison"]

    def held_traces(self, asked: Asked) -> Any:
        """Held-out traces of the last fit."""
        from auvnn.app.where import held_out_traces

        with self.session.lock:
            folder = self.session.answers.get("improvement")
        if folder is None:
            raise ConfigError("nothing has been fitted yet")
        return held_out_traces(folder, *span(asked))

    def trial(self) -> Any:
        """Model and log for free runs by hand."""
        from auvnn.app.trial import Trial
        from auvnn.models import load

        with self.session.lock:
            source = self.session.source
            if source is None or source.fit is None or not self.session.history:
                raise ConfigError("choose a log and a model first")
            if "trial" not in self.session.views:
                model = load(self.session.history[-1].source, actuation=source.fit.kind)
                self.session.views["trial"] = Trial(model, source.fit)
            return self.session.views["trial"]

    def effects(self, asked: Asked) -> Any:
        """The catalogue, as the model and the log see it."""
        from auvnn.app.trial import catalogue

        trial = self.trial()
        return catalogue(trial.model, trial.log)

    def attempt(self, asked: Asked) -> Any:
        """Run free with effects at given values."""
        effects = asked.get("effects") or {}
        if not isinstance(effects, dict) or not all(isinstance(v, dict) for v in effects.values()):
            raise ConfigError("effects are given as {name: {parameter: value}}")
        number, low, high, points = span(asked)
        from auvnn.app.trial import HORIZONS

        horizon = str(asked.get("horizon", "full"))
        if horizon not in HORIZONS:
            raise ConfigError(f"horizon {horizon}: choose {', '.join(HORIZONS)}")
        flags = (asked.get("whole") is not False, asked.get("judge") is not False)
        return self.trial().run(effects, horizon, number, low, high, points, *flags)

    def script(self, asked: Asked) -> Any:
        """The commands and the script, and where they would be saved."""
        folder = saving.proposed(self.session)
        told = self.session.told()
        return {"commands": commands(told, folder.absolute()), "python": python(told), "folder": str(folder)}

    def save(self, asked: Asked) -> Any:
        """Write everything into a folder."""
        text = str(asked.get("folder") or "").strip()
        folder = Path(text) if text else saving.proposed(self.session)
        held, without = saving.save(self.session, folder)
        return {"folder": str(folder.expanduser().absolute()), "holds": held, "without": without}

    async def report(self, request: Request) -> Response:
        """A report as one page that runs nothing."""
        with self.session.lock:
            folder = self.session.answers.get(request.path_params["kind"])
        path = None if folder is None else folder / "report.html"
        if path is None or not path.is_file():
            return refused("the report is not drawn yet: try again in a moment", 404)
        text = await run_in_threadpool(path.read_text, "utf-8")
        return HTMLResponse(text, headers={"content-security-policy": REPORT_POLICY})


async def _page(request: Request) -> Response:
    return HTMLResponse((STATIC / "index.html").read_text(encoding="utf-8"))
