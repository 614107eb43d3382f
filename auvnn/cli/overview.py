"""What `auvnn` alone says: the verbs, the effects and the vehicles, without loading anything heavy."""

from __future__ import annotations

from auvnn import __version__
from auvnn.cli.verbs import VERBS
from auvnn.config import config_dir


def overview() -> str:
    """Return the overview as text."""
    from auvnn.effects import EFFECTS

    verbs = "\n".join(f"  {name:<10} {VERBS.get(name).summary}" for name in VERBS.names())
    vehicles = sorted(path.stem for path in (config_dir() / "vehicle").glob("*.yaml"))
    return f"""\
auvnn {__version__}: compare a vehicle's model with its log, name the physical effect that is missing, add it.

verbs       auvnn VERB key=value ...; auvnn VERB --help
{verbs}

effects     that diagnose looks for, and add, remove and simulate take
{_wrapped(EFFECTS.names())}

vehicles    for model=, or your own YAML file or model folder
{_wrapped(vehicles)}

pages       auvnn effects [NAME], an effect's equation and parameters; auvnn docs [PAGE], the documentation
shell       auvnn completion bash|zsh|fish, a script that completes verbs, keys and names; auvnn version

Start with: auvnn demo"""


def _wrapped(names: list[str], width: int = 96) -> str:
    import textwrap

    text = ", ".join(names)
    return textwrap.fill(text, width, initial_indent="  ", subsequent_indent="  ", break_long_words=False)
