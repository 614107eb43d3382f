"""What the server knows: the log, the model and its history, the answers, and the one job that runs."""

from __future__ import annotations

import json
import shutil
import threading
import time
from pathlib import Path
from typing import Any

from auvnn.app.jobs.child import Child
from auvnn.app.records import ANSWERS, KINDS, MODELS, Job, Step, step_of, words_of
from auvnn.app.script import Told
from auvnn.app.source import Source
from auvnn.errors import AuvnnError, ConfigError, one_line

LONG = 100_000  # samples from which on the quality report takes seconds


class Session:
    """Everything that one page works on; survives a reload because it lives here.

    Args:
        work: folder for uploads and answers, taken away at the end.
        out: folder into which the user saves.
        model: name or path of the model to begin with, None for none.
    """

    def __init__(self, work: Path, out: Path, model: str | None = None) -> None:
        self.work, self.out = work, out
        self.lock = threading.RLock()
        self.version = 1
        self.source: Source | None = None
        self.history: list[Step] = [Step(model, "as given")] if model else []
        self.taken_back: list[Step] = []
        self.answers: dict[str, Path] = {}
        self.summaries: dict[str, dict[str, Any]] = {}
        self.stale: set[str] = set()
        self.job: Job | None = None
        self.saved: list[str] = []
        self.reading, self._numbers = "", 0
        self.views: dict[str, Any] = {}
        self.looked = threading.Event()
        self.child = Child(work, self._hear)

    def open(self, source: Source) -> None:
        """Read a log and make it the one that the page works on; what was found on another one is forgotten.

        Raises:
            AuvnnError: a job is running.
        """
        with self.lock:
            self.refuse_busy()
            self.reading = ", ".join(p.name for p in source.files)
            self.version += 1
        try:
            source.read()
        finally:
            with self.lock:
                self.reading = ""
        with self.lock:
            self.source = source
            self._forget()
        threading.Thread(target=self._judge, args=(source,), daemon=True).start()

    def _judge(self, source: Source) -> None:
        # A long log takes a while to be judged; who has just opened it looks at the traces first.
        if source.log is not None and source.log.samples > LONG:
            self.looked.wait(3.0)
        self.looked.clear()
        try:
            source.judge()
        except Exception as error:
            source.findings = []
            source.error = f"the quality report failed: {type(error).__name__}: {one_line(error, 300)}"
        with self.lock:
            self.version += 1
            ready = source is self.source and source.log is not None
        if ready:
            # By the time somebody presses a button the child has loaded what it needs.
            self.child.warm()

    def choose_model(self, source: str) -> None:
        """Begin with another model.

        Raises:
            AuvnnError: it cannot be loaded, or a job is running.
        """
        from auvnn.models import load

        load(
            source, actuation=None if self.source is None or self.source.log is None else self.source.log.kind
        )
        with self.lock:
            self.refuse_busy()
            self.history, self.taken_back = [Step(source, "as given")], []
            self._forget()

    def _forget(self) -> None:
        """Forget what was found with another log or another model; `self.lock` is held."""
        for folder in self.answers.values():
            shutil.rmtree(folder, ignore_errors=True)
        self.answers, self.summaries, self.views, self.stale = {}, {}, {}, set()
        self.history, self.taken_back = self.history[:1], []
        self.version += 1

    def refuse_busy(self) -> None:
        """Refuse what would change the ground under a job.

        Raises:
            ConfigError: a job is running.
        """
        if self.job is not None and self.job.state == "running":
            raise ConfigError(f"{self.job.words} is running: wait for it, or stop it first")
        if self.reading:
            raise ConfigError(f"{self.reading} is being read: wait for it")

    def start(self, kind: str, effects: list[str] | None = None, force: bool = False) -> None:
        """Start a job in the child process.

        Raises:
            AuvnnError: another one is running, or a log or a model is missing.
        """
        if kind not in KINDS:
            raise ConfigError(f"no job called '{kind}'; there are: {', '.join(KINDS)}")
        with self.lock:
            self.refuse_busy()
            order: dict[str, Any] = {"kind": kind, "force": force}
            if kind != "example":
                if self.source is None or self.source.log is None:
                    raise ConfigError("there is no log yet: drop a file, or choose one")
                if not self.history:
                    raise ConfigError("there is no model yet: choose a vehicle, a YAML file or a saved model")
                order.update(log=self.source.order(), model=self.history[-1].source)
            if kind == "add":
                if not effects:
                    raise ConfigError("no effect is switched on: switch one on first")
                order["effects"] = effects
            self._numbers += 1
            words = words_of(kind, effects or [])
            out = self.work / "answers" / f"{self._numbers}_{kind}"
            order.update(job=self._numbers, out=str(out))
            self.job = Job(self._numbers, kind, words, out, time.monotonic(), effects=tuple(effects or ()))
            self.version += 1
            try:
                self.child.order(order)
            except AuvnnError as error:
                self.job.state, self.job.error = "failed", str(error)
                raise

    def stop(self) -> None:
        """Stop the job that runs; nothing of it is kept."""
        with self.lock:
            job = self.job
            if job is None or job.state != "running":
                return
            job.state, job.seconds = "stopped", time.monotonic() - job.began
            self.version += 1
        self.child.stop()
        shutil.rmtree(job.out.with_name(f".{job.out.name}.part"), ignore_errors=True)
        shutil.rmtree(job.out, ignore_errors=True)
        self.child.warm()

    def _hear(self, report: dict[str, Any]) -> None:
        """Take a report of the child process."""
        opened: Source | None = None
        with self.lock:
            self.version += 1
            job = self.job
            if job is None or job.state != "running":
                return
            if "ended" in report:
                job.state, job.error = (
                    "failed",
                    f"the worker process ended with status {report['ended']}; try again",
                )
            elif report.get("job") != job.number:
                return
            elif "progress" in report:
                job.lines.append(report["progress"])
                return
            elif "error" in report:
                job.state, job.error = "failed", report["error"]
            elif "done" in report:
                job.state = "done"
                if job.kind == "example":
                    self.history, self.taken_back = [Step(report["done"]["model"], "as given")], []
                    opened = Source([Path(report["done"]["file"])])
                else:
                    self._keep_answer(job, report["done"])
            job.seconds = time.monotonic() - job.began
        if opened is not None:
            self.open(opened)

    def _keep_answer(self, job: Job, summary: dict[str, Any]) -> None:
        kind = ANSWERS[job.kind]
        old = self.answers.get(kind)
        if old is not None and old not in [s.answer for s in self.history]:
            shutil.rmtree(old, ignore_errors=True)
        self.answers[kind], self.summaries[kind] = job.out, summary
        self.views.pop(kind, None)
        self.stale.discard(kind)

    def keep(self, kind: str = "improvement") -> None:
        """Go on with the model of the last fit, or of the whole loop, by the `kind` of the answer that holds it.

        Raises:
            ConfigError: there is none, or it is in the model already.
        """
        with self.lock:
            self.refuse_busy()
            if kind not in MODELS or not self._new(kind):
                raise ConfigError("there is no new fit to keep: press Fit or Improve first")
            self.history.append(step_of(kind, self.answers[kind], self.answer(kind)))
            self.taken_back = []
            self._model_changed()

    def _new(self, kind: str) -> bool:
        """Whether an answer holds a model that has not been kept."""
        return kind in self.answers and self.answers[kind] not in [s.answer for s in self.history]

    def take_back(self) -> None:
        """Go back to the model before the last fit that was kept.

        Raises:
            ConfigError: nothing was kept.
        """
        with self.lock:
            self.refuse_busy()
            if len(self.history) < 2:
                raise ConfigError("the model is as it was given: there is nothing to take back")
            self.taken_back.append(self.history.pop())
            self._model_changed()

    def _model_changed(self) -> None:
        self.stale |= {"comparison", "diagnosis"} & set(self.answers)
        self.views.pop("trial", None)
        self.version += 1

    def answer(self, kind: str) -> dict[str, Any]:
        """Return an answer with what goes beside it.

        Raises:
            ConfigError: there is none yet.
        """
        with self.lock:
            folder = self.answers.get(kind)
        if folder is None:
            raise ConfigError(f"there is no {kind} yet")
        answer, more = (
            json.loads((folder / f"{n}.json").read_text(encoding="utf-8")) for n in (kind, "more")
        )
        return {**answer, "more": more}

    def told(self) -> Told:
        """Return what was done, for the commands and the script."""
        with self.lock:
            if self.source is None or self.source.log is None or not self.history:
                raise ConfigError("there is no log and no model yet")
            steps = tuple(() if step.kind == "improve" else step.effects for step in self.history[1:])
            return Told(self.history[0].source, self.source.log.kind, steps, "diagnosis" in self.answers,
                        self.source.held is not None)  # fmt: skip

    def state(self) -> dict[str, Any]:
        """Return what the page needs to know at any moment."""
        with self.lock:
            source = self.source
            return {
                "version": self.version,
                "reading": self.reading,
                "log": None if source is None else {
                    "name": source.log.name if source.log else source.files[0].name,
                    "error": source.error,
                    "ready": source.log is not None,
                    "judged": source.findings is not None,
                    "samples": source.log.samples if source.log else 0,
                    "sizes": source.sizes,
                    "held": source.words,
                },
                "history": [
                    {"words": s.words, "source": s.source if s.answer is None else "", "effects": list(s.effects),
                     "error": s.error} for s in self.history
                ],
                "taken_back": [s.words for s in self.taken_back],
                "can_keep": self._new("improvement"),
                "can_keep_improved": self._new("improve"),
                "answers": {k: {"summary": self.summaries[k], "stale": k in self.stale,
                                "report": (p / "report.html").is_file()} for k, p in self.answers.items()},
                "job": None if self.job is None else self.job.told(),
                "saved": self.saved,
                "out": str(self.out),
            }  # fmt: skip

    def close(self) -> None:
        """End the child process and take the work folder away."""
        self.child.close()
        shutil.rmtree(self.work, ignore_errors=True)
