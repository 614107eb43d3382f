"""What the child process can do: the same Python calls as the commands, each answer in a separate folder."""

from __future__ import annotations

import json
import shutil
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch

from auvnn.answers import Answer, plain, write_text
from auvnn.app.jobs.messages import AddJob, LogJob, Order, Summary
from auvnn.app.source import split
from auvnn.cards import still_beaten
from auvnn.comparison import compare
from auvnn.comparison.predictions import write_predictions
from auvnn.diagnosis import diagnose
from auvnn.errors import AuvnnError, one_line
from auvnn.improvement import add, improve
from auvnn.logs import Log
from auvnn.metrics.rollouts import HORIZONS, NAMES, scale_of
from auvnn.models import GreyBox, load

Say = Callable[[str], None]
SECONDS = 300.0  # after which the whole loop begins nothing new


class Tasks:
    """Does orders; remembers the last log and the answers whose reports are still to be drawn."""

    def __init__(self) -> None:
        torch.set_num_threads(1)
        self._log: tuple[str, Log, Log | None] | None = None
        self._pending: list[tuple[Answer, Path]] = []

    def do(self, order: Order, say: Say) -> Summary:
        """Do what an order says and return a summary; the answer is in the folder `out` then, or nothing is.

        Args:
            order: `kind`, `log` (files, mapping, max_duration, test), `model`, `out`, and what the kind takes.
            say: called with what is being done, in words.

        Raises:
            AuvnnError: what the user gave cannot be used.
        """
        kinds: dict[str, Callable[[Any, Path, Say], tuple[Summary, Answer | None]]] = {
            "compare": self._compare,
            "diagnose": self._diagnose,
            "add": self._add,
            "improve": self._improve,
            "example": self._example,
        }
        out = Path(order["out"])
        beside = out.with_name(f".{out.name}.part")
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(parents=True)
        try:
            summary, answer = kinds[order["kind"]](order, beside, say)
            beside.rename(out)
        except BaseException:
            shutil.rmtree(beside, ignore_errors=True)
            raise
        if answer is not None:
            self._pending.append((answer, out / "report.html"))
        return plain(summary)

    def draw_one(self) -> Iterator[tuple[str, str]]:
        """Draw one report that is still to be drawn, if any, and yield its folder and why it could not be drawn."""
        if self._pending:
            answer, path = self._pending.pop(0)
            if path.parent.is_dir():
                problem = ""
                try:
                    answer.report(path)
                except Exception as error:
                    # The answer is whole without it; whoever saves is informed.
                    traceback.print_exc()
                    problem = f"{type(error).__name__}: {one_line(error, 200)}"
                yield str(path.parent), problem

    def draw_all(self) -> Iterator[tuple[str, str]]:
        """Draw all reports that are still to be drawn: a stopped job must not take them along."""
        while self._pending:
            yield from self.draw_one()

    def _logs(self, order: LogJob, say: Say) -> tuple[Log, Log | None]:
        wanted = order["log"]
        key = json.dumps(wanted, sort_keys=True)
        if self._log is None or self._log[0] != key:
            say("reading the log")
            log = Log.read(wanted["files"], wanted["mapping"] or None, max_duration=wanted["max_duration"])
            if wanted["test"]:
                self._log = (key, log, Log.read(wanted["test"], wanted["mapping"] or None))
            else:
                self._log = (key, *split(log)[:2])
        return self._log[1], self._log[2]

    def _model(self, order: LogJob, log: Log) -> GreyBox:
        return load(order["model"], actuation=log.kind)

    def _compare(self, order: LogJob, out: Path, say: Say) -> tuple[Summary, Answer]:
        log, _ = self._logs(order, say)
        model = self._model(order, log)
        say("one step ahead, and free running from 0.5 s to the whole run")
        comparison = compare(model, log)
        scale = scale_of(log)
        floors = {h: comparison.rollout.get(h, {}).get("noise_floor") for h in HORIZONS}
        more = {
            "regimes": comparison.regimes,
            "wrench_floor": comparison.noise_floor,
            "floors": floors,
            "scale": dict(zip(NAMES, scale.std, strict=True)),
        }
        _write(comparison, out, more)
        write_predictions(comparison.series, out / "predictions.parquet")
        five = comparison.rollout.get("5", {})
        return {
            "total": five.get("total"),
            "persistence": five.get("persistence"),
            "floor": floors.get("5"),
        }, comparison

    def _diagnose(self, order: LogJob, out: Path, say: Say) -> tuple[Summary, Answer]:
        log, _ = self._logs(order, say)
        diagnosis = diagnose(self._model(order, log), log, progress=say, force=bool(order.get("force")))
        _write(diagnosis, out, {"story": diagnosis.story})
        return {"verdict": diagnosis.verdict, "missing": diagnosis.missing}, diagnosis

    def _add(self, order: AddJob, out: Path, say: Say) -> tuple[Summary, Answer]:
        log, test = self._logs(order, say)
        model = self._model(order, log)
        if test is None:
            raise AuvnnError("the log is too short to hold a part of it out: name a further log to judge by")
        # On the page it is seen which effects the model has.
        better = add(
            model, log, order["effects"], test=test, refit=True, progress=say, force=bool(order.get("force"))
        )
        better.model.save(out / "model")
        more = {
            "held_out_words": order["log"]["words"],
            "effects_in_model": better.model.effect_names,
            "beaten": still_beaten(better.baseline),
        }
        _write(better, out, more)
        parts = ("t", "measured", "before", "refitted", "after")
        arrays: dict[str, Any] = {
            f"{s['run']}:{key}": np.asarray(s[key], float) for s in better.series for key in parts
        }
        with (out / "series.npz").open("wb") as stream:
            np.savez(stream, **arrays)
        return {"accepted": better.accepted, "waterfall": better.waterfall, "gain": better.gain}, better

    def _improve(self, order: LogJob, out: Path, say: Say) -> tuple[Summary, Answer]:
        log, test = self._logs(order, say)
        if test is None:
            raise AuvnnError("the log is too short to hold a part of it out: name a further log to judge by")
        options = {"test": test, "progress": say, "tell": say, "force": bool(order.get("force"))}
        found = improve(self._model(order, log), log, seconds=order.get("seconds", SECONDS), **options)
        more = {"held_out_words": order["log"]["words"], "effects_in_model": found.model.effect_names}
        _write(found, out, more)
        return {"verdict": found.verdict, "waterfall": found.waterfall}, found

    def _example(self, order: Order, out: Path, say: Say) -> tuple[Summary, Answer | None]:
        from auvnn.studies.demo import VEHICLE, made_logs

        say("simulating four runs of 60 s in a current that the model does not know")
        made, _, _ = made_logs(load(VEHICLE))
        path = out / "demo.parquet"
        made.log.write(path)
        return {"file": str(Path(order["out"]) / path.name), "model": VEHICLE}, None


def _write(answer: Answer, out: Path, more: dict[str, Any]) -> None:
    answer.write(out, report=False)
    write_text(out / "more.json", json.dumps(plain(more), allow_nan=False))
