"""A verb as a Hydra application: compose, look before leaping, run each job in its own folder."""

from __future__ import annotations

import contextlib
import itertools
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from auvnn.answers import write_text
from auvnn.cli.faults import OK, outcome
from auvnn.cli.options.compose import Composer
from auvnn.cli.options.foreign import read_configs, write_configs
from auvnn.cli.options.suggestions import corrected, quoted
from auvnn.cli.options.words import Words
from auvnn.cli.runs.folder import created, locked, refuse_taken, written
from auvnn.cli.runs.job import Job, Verb, files
from auvnn.cli.runs.sweep import jobs_of, note, run_jobs, statuses
from auvnn.cli.runs.working import WORK, refuse_links, take_away
from auvnn.cli.speech import Speaker, complain
from auvnn.config import config_dir
from auvnn.errors import AuvnnError, ConfigError, one_line
from auvnn.executors.safe_path import ray_kept_safe


def run_verb(name: str, verb: Verb, arguments: list[str]) -> int:
    """Run one verb with its command-line arguments and return the exit status.

    Args:
        name: of the verb, which its config has too.
        verb: what it reads, writes and does.
        arguments: the words after the verb, as in `sys.argv[2:]`.

    Raises:
        AuvnnError: the arguments are wrong; nothing has been touched.
    """
    words = Words.split(arguments)
    with contextlib.ExitStack() as stack:
        configs, copied = _configs(words.config_dir, stack)
        composer = Composer(name, copied, f"--config-dir {words.config_dir}")
        return _run_verb(name, verb, words, composer, configs)


def _configs(given: str | None, stack: contextlib.ExitStack) -> tuple[dict[str, str] | None, Path | None]:
    """Return what a user's folder of configs holds, and our own copy of it, which goes with the stack."""
    if given is None:
        return None, None
    if not Path(given).is_dir():
        raise ConfigError(f"--config-dir {given}: there is no such folder")
    configs = read_configs(Path(given))
    place = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="auvnn-configs-")))
    return configs, write_configs(configs, place)


def _run_verb(name: str, verb: Verb, words: Words, composer: Composer, configs: dict[str, str] | None) -> int:
    folder = [] if composer.folder is None else ["--config-dir", str(composer.folder)]
    overrides = composer.checked([corrected(w) for w in words.overrides], sweep=words.multirun)
    config = composer.compose(overrides)
    if words.shows:
        _hydra(name, [*words.flags, *folder, *overrides], lambda _: None)
        return OK
    out = _dated(name) if config.out is None else Path(str(config.out)).expanduser()
    overrides.append(f"out={quoted(out)}")
    refuse_taken(out, overwrite=config.overwrite is True)
    if words.multirun:
        refuse_links(out, out, "multirun.yaml")  # Hydra writes it
    jobs = jobs_of(overrides) if words.multirun else [overrides]
    composer.judge_jobs(jobs)
    with contextlib.ExitStack() as stack:
        if config.dry_run:
            # Hydra makes its folders whatever we do; these go away again.
            nowhere = quoted(stack.enter_context(tempfile.TemporaryDirectory()))
            places = [f"hydra.run.dir={nowhere}", f"hydra.sweep.dir={nowhere}"]
        else:
            places = []
            stack.enter_context(created(out))
            if words.multirun:
                stack.enter_context(locked(out))
        if words.jobs:
            flags = [f for f in words.flags if f not in ("-m", "--multirun")]
            # Each job reads and judges the user's own folder.
            flags += [] if words.config_dir is None else ["--config-dir", words.config_dir]
            ended = run_jobs(name, flags, overrides, out, words.jobs)
        elif words.multirun:
            # A launcher may run jobs in other processes, on other machines: how they ended comes back by files.
            tally = Path(
                stack.enter_context(tempfile.TemporaryDirectory()) if config.dry_run else out
            ).absolute()
            if configs is not None and not config.dry_run:
                # Where the launcher's processes see it too, on whatever machine.
                take_away(tally / WORK / "configs")
                shared = write_configs(configs, tally / WORK / "configs")
                stack.callback(take_away, shared)
                folder = ["--config-dir", str(shared)]
            arguments = [*words.flags, *folder, *overrides, *places]
            with statuses(tally, len(jobs)) as ended:
                _launched(name, arguments, partial(_counted, name, verb, composer, tally))
        else:
            ended = []
            _hydra(
                name,
                [*words.flags, *folder, *overrides, *places],
                lambda job: ended.append(_job(name, verb, composer, job)),
            )
    failed = [number for number, status in enumerate(ended) if status != OK]
    if words.multirun and failed:
        complain(f"auvnn {name}: {len(failed)} of {len(ended)} jobs failed: {', '.join(map(str, failed))}")
    return min((ended[n] for n in failed), default=OK)


def _counted(name: str, verb: Verb, composer: Composer, tally: Path, config: DictConfig) -> None:
    """Run one job of many, wherever a launcher put it, and leave its status."""
    note(tally, HydraConfig.get().job.num, _job(name, verb, composer, config))


def _launched(name: str, arguments: list[str], task: Callable[[DictConfig], Any]) -> None:
    """Run many jobs by Hydra's launcher; one that gives up leaves what it has done."""
    try:
        with ray_kept_safe():
            _hydra(name, arguments, task)
    except AuvnnError:
        raise
    except Exception as error:
        complain(f"auvnn {name}: the launcher gave up: {type(error).__name__}: {one_line(error, 300)}")


def _job(name: str, verb: Verb, composer: Composer, config: DictConfig) -> int:
    """Run one job of perhaps many; its failure does not stop the others."""
    own = HydraConfig.get()
    number = own.job.num if own.mode == RunMode.MULTIRUN else None
    root = own.run.dir if number is None else own.sweep.dir
    out = Path(str(config.out)) / os.path.relpath(own.runtime.output_dir, str(root))
    label = f"auvnn {name}" if number is None else f"auvnn {name} (job {number})"

    def run() -> None:
        refuse_links(Path(str(config.out)), out)
        _run(verb, composer, config, out)

    status = outcome(label, run, None if config.dry_run else out)
    with contextlib.suppress(OSError):
        out.rmdir()  # made by Hydra; taken away if nothing came into it
    return status


def _run(verb: Verb, composer: Composer, config: DictConfig, out: Path) -> None:
    options = composer.options(config)
    say = Speaker(only_json=options["json"], verbose=options["verbose"])
    for key in verb.reads:
        # A model may also be a name, which is not ours to judge.
        named = options[key] if isinstance(options[key], list) else [options[key]]
        paths = [n for n in named if n is not None and (key != "model" or _is_path(n))]
        if paths or (named == [] and key != "model"):
            files({key: paths}, key)
    if options["dry_run"]:
        refuse_taken(out, overwrite=options["overwrite"])
        if verb.dry_run is not None:
            verb.dry_run(Job(options, out, out, say))
        for key in verb.reads:
            if options[key] is not None:
                say(f"would read   {key}={options[key]}")
        if verb.writes:
            say(f"would write  {', '.join(verb.writes)} in {out}")
        return
    if not verb.writes:
        # It writes what its user asks for while it runs, and nothing else.
        say.answer(verb.run(Job(options, out, out, say)).to_dict())
        return
    with written(out, overwrite=options["overwrite"]) as folder:
        with say.ticking("working"):
            answer = verb.run(Job(options, out, folder, say))
        write_text(folder / ".hydra" / "config.yaml", OmegaConf.to_yaml(config))
        write_text(folder / ".hydra" / "overrides.yaml", OmegaConf.to_yaml(HydraConfig.get().overrides.task))
    say(f"written   {', '.join(verb.writes)} in {out}")
    if "report.html" in verb.writes:
        say(f"report    {out / 'report.html'}", style="bold")
    say.answer(answer.to_dict())


def _hydra(name: str, arguments: list[str], task: Callable[[DictConfig], Any]) -> None:
    """Run a task as a Hydra application that leaves its errors to us."""
    with _seen([f"auvnn {name}", *arguments]):
        try:
            hydra.main(version_base="1.3", config_path=str(config_dir()), config_name=name)(task)()
        except (HydraException, OmegaConfBaseException) as error:
            raise ConfigError(one_line(error)) from None


@contextlib.contextmanager
def _seen(arguments: list[str]) -> Iterator[None]:
    before, full = sys.argv, os.environ.get("HYDRA_FULL_ERROR")
    sys.argv, os.environ["HYDRA_FULL_ERROR"] = arguments, "1"
    try:
        yield
    finally:
        sys.argv = before
        if full is None:
            del os.environ["HYDRA_FULL_ERROR"]
        else:
            os.environ["HYDRA_FULL_ERROR"] = full


def _is_path(source: Any) -> bool:
    return any(sign in str(source) for sign in ("/", "\\", ".", "~"))


def _dated(verb: str) -> Path:
    stem = f"{time.strftime('%Y-%m-%d_%H-%M-%S')}_{verb}"
    names = itertools.chain([stem], (f"{stem}_{n}" for n in itertools.count(2)))
    return next(path for path in (Path("outputs") / name for name in names) if not path.exists())
