"""What the server knows: the log, the model and its history, the answers, and the one job that runs."""

from __future__ import annotations

import shutil
import threading
import time
from pathlib import Path
from typing import cast

from auvnn.app.jobs.child import Child
from auvnn.app.jobs.messages import AddJob, Example, LogJob, Order, Report, Summary
from auvnn.app.records import ANSWERS, KINDS, MODELS, Job, Step, step_of, words_of
from auvnn.app.session_state import SessionState
from auvnn.app.source import Source
from auvnn.errors import AuvnnError, ConfigError, one_line

LONG = 100_000  # samples from which on the quality report takes seconds
ANSWERED = 5.0  # s, within which the child says whether it has begun a job


class Session(SessionState):
    """Everything that one page works on; survives a reload because it lives here.

    Args:
        work: folder for uploads and answers, taken away at the end.
        out: folder into which the user saves.
        model: name or path of the model to begin with, None for none.
    """

    def __init__(self, work: Path, out: Path, model: str | None = None) -> None:
        super().__init__(work, out, model)
        self.child = Child(work, self._hear)
        self._left_out, self._skipped = threading.Event(), False

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

    def start(self, kind: str, effects: list[str] | None = None, force: bool = False) -> None:
        """Start a job in the child process.

        Args:
            kind: which job: one of `KINDS`.
            effects: names for jobs that take effects; the job's own choice where None.
            force: go on with a log that contradicts itself.

        Raises:
            AuvnnError: another one is running, or a log or a model is missing.
        """
        if kind not in KINDS:
            raise ConfigError(f"no job called '{kind}'; there are: {', '.join(KINDS)}")
        with self.lock:
            self.refuse_busy()
            number = self._numbers + 1
            out = self.work / "answers" / f"{number}_{kind}"
            order: Order = {"kind": kind, "job": number, "out": str(out)}
            if kind != "example":
                if self.source is None or self.source.log is None:
                    raise ConfigError("there is no log yet: drop a file, or choose one")
                if not self.history:
                    raise ConfigError("there is no model yet: choose a vehicle, a YAML file or a saved model")
                on_log: LogJob = {
                    **order, "force": force, "log": self.source.order(), "model": self.history[-1].source,
                }  # fmt: skip
                order = on_log
                if kind == "add":
                    if not effects:
                        raise ConfigError("no effect is switched on: switch one on first")
                    adding: AddJob = {**on_log, "effects": effects}
                    order = adding
            self._numbers = number
            words = words_of(kind, effects or [])
            self.job = Job(number, kind, words, out, time.monotonic(), effects=tuple(effects or ()))
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
        # Before a job begins the child draws the reports of what was found before: these must not end with it.
        self._left_out.clear()
        self._skipped = False
        if self.child.skip(job.number) and self._left_out.wait(ANSWERED) and self._skipped:
            return
        self.child.stop()
        shutil.rmtree(job.out.with_name(f".{job.out.name}.part"), ignore_errors=True)
        shutil.rmtree(job.out, ignore_errors=True)
        self.child.warm()

    def _hear(self, report: Report) -> None:
        """Take a report of the child process."""
        opened: Source | None = None
        with self.lock:
            self.version += 1
            job = self.job
            if "left_out" in report:
                self._skipped = report["left_out"]
                self._left_out.set()
                return
            if "drawn" in report:
                if problem := report.get("problem"):
                    self.undrawn[report["drawn"]] = problem
                return
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
                    made = cast(Example, report["done"])
                    self.history, self.taken_back = [Step(made["model"], "as given")], []
                    opened = Source([Path(made["file"])])
                else:
                    self._keep_answer(job, report["done"])
            job.seconds = time.monotonic() - job.began
        if opened is not None:
            self.open(opened)

    def _keep_answer(self, job: Job, summary: Summary) -> None:
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

    def take_back(self) -> None:
        """Go back to the model before the last fit that was kept.

        Raises:
            ConfigError: nothing was kept.
        """
        with self.lock:
            self.refuse_busy()
            if len(self.history) < 2:
                raise ConfigError("the model is as given: there is nothing to take back")
            self.taken_back.append(self.history.pop())
            self._model_changed()

    def _model_changed(self) -> None:
        self.stale |= {"comparison", "diagnosis"} & set(self.answers)
        self.views.pop("trial", None)
        self.version += 1

    def close(self) -> None:
        """End the child process and take the work folder away."""
        self.child.close()
        shutil.rmtree(self.work, ignore_errors=True)
