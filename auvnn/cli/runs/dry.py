"""What a dry run can find out: whether the model, the names and the beginning of each log could be used."""

from __future__ import annotations

from typing import Any

from auvnn.cli.runs.job import Job, files
from auvnn.errors import ConfigError


def check_inputs(job: Job, several: bool = False) -> None:
    """Refuse what the verb itself would refuse, as far as that costs next to nothing.

    Read are the model, the mapping and the first rows of every log; names of effects and their parameters are looked up.

    Raises:
        AuvnnError: something cannot be used, in the words that the verb would have.
    """
    options = job.options
    kinds = _beginnings(job)
    model = _model(job, kinds, several)
    for key in ("effect", "effects", "hidden"):
        # Nothing may be hidden; a list of effects to look for must not be empty.
        if options.get(key) is not None and not (key == "hidden" and options[key] == []):
            _names(job, key, model)
    if "window" in options:
        from auvnn.diagnosis.hypotheses.candidates import check_window_length

        check_window_length(options["window"])


def _beginnings(job: Job) -> tuple[str, ...] | None:
    """Return what commands the first rows of the log have; None where there is no log."""
    from auvnn.logs.reading.mapping_file.mapping import Mapping
    from auvnn.logs.reading.portions import kinds_of

    mapping, found = job.mapping(), None
    if mapping is not None:
        Mapping.read(mapping)
    for key in ("log", "test"):
        if job.options.get(key) is None:
            continue
        for path in files(job.options, key):
            kinds = kinds_of([path], mapping)
            found = kinds if found is None else found
    return found


def _model(job: Job, kinds: tuple[str, ...] | None, several: bool = False) -> Any:
    source = job.options.get("model")
    if source is None:
        return None
    from auvnn.cli.speech import Speaker

    quiet = Job(job.options, job.out, job.folder, Speaker(only_json=True))
    if isinstance(source, list) and several:
        found = [quiet.model(kinds=kinds or (), source=name) for name in quiet.names("model")]
        return found[0]
    return quiet.model(kinds=kinds or ())


def _names(job: Job, key: str, model: Any) -> None:
    from auvnn.effects import effect_class
    from auvnn.effects.acting_beside import in_words, needed_beside

    value = job.options[key]
    named = value if isinstance(value, dict) else dict.fromkeys(job.names(key))
    for name, values in named.items():
        kind = effect_class(str(name))
        if model is None:
            continue
        there = key == "effect" and "log" in job.options and name in model.effect_names
        if there and not job.options.get("refit"):
            from auvnn.improvement.add import THERE

            raise ConfigError(THERE.format(name))
        lacking = kind.lacks(model.vehicle, model.actuation)
        if lacking and key != "effects":
            raise ConfigError(
                f"{name} needs {lacking[0]}, which the file of {model.vehicle.name} does not state"
            )
        needed = needed_beside(str(name), (*map(str, named), *model.effect_names))
        if needed and key != "effects":
            raise ConfigError(f"{name} does nothing by itself: name {in_words(needed)} with it")
        kind.build(model.vehicle, model.actuation, values)
