"""What is shown without doing anything: quickly, and without loading what is not needed."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
import yaml

from auvnn.cli.main import VERBS
from auvnn.config import config_dir
from tests.cli.stand_ins import ENVIRONMENT

HEAVY = ("torch", "matplotlib", "scipy", "polars", "hydra", "rich")


def _python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=ENVIRONMENT)


def loaded_by(code: str) -> set[str]:
    script = f"import sys\n{code}\nprint(*sys.modules, sep='\\n', file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=ENVIRONMENT
    )
    return {name.split(".")[0] for name in done.stderr.splitlines()}


def test_importing_auvnn_loads_nothing_heavy():
    assert not loaded_by("import auvnn; dir(auvnn); auvnn.__version__") & {*HEAVY, "numpy"}


@pytest.mark.parametrize("arguments", [[], ["--help"], ["--version"]])
def test_the_overview_loads_nothing_heavy(arguments):
    assert not loaded_by(f"from auvnn.cli.main import main; main({arguments})") & set(HEAVY)


def test_the_overview_lists_verbs_effects_and_vehicles(auvnn):
    status, out, err = auvnn()
    assert (status, err) == (0, "")
    vehicles = [path.stem for path in (config_dir() / "vehicle").glob("*.yaml")]
    from auvnn.effects import EFFECTS

    for name in [*VERBS.names(), *EFFECTS.names(), *vehicles]:
        assert name in out


def test_python_m_is_the_same():
    done = subprocess.run(
        [sys.executable, "-m", "auvnn", "--version"], capture_output=True, text=True, env=ENVIRONMENT
    )
    assert done.returncode == 0 and done.stdout.startswith("auvnn ")


@pytest.mark.parametrize("verb", VERBS.names())
def test_help_explains_every_option(auvnn, verb):
    status, out, err = auvnn(verb, "--help")
    assert (status, err) == (0, "")
    text = out.replace(f"auvnn {verb} ", "")
    options = yaml.safe_load((config_dir() / f"{verb}.yaml").read_text())
    groups = [g for entry in options.pop("defaults") if isinstance(entry, dict) for g in entry]
    groups = [g for g in groups if not g.startswith("override")]
    output = yaml.safe_load((config_dir() / "options" / "output.yaml").read_text())
    for key in [*options, *groups, *output]:
        if key != "hydra":
            assert f"\n{key}= " in text, key


@pytest.mark.parametrize("verb", VERBS.names())
def test_the_composed_options_can_be_shown(auvnn, verb):
    status, out, err = auvnn(verb, "--cfg", "job")
    assert (status, err) == (0, "")
    assert {"out", "overwrite", "json", "dry_run"} <= set(yaml.safe_load(out))


@pytest.mark.parametrize("verb", ["adapt", "train", "study"])
def test_the_help_lists_the_choices_of_its_own_groups_and_no_others(auvnn, verb):
    """Of each group of configurations that the verb composes, every member; a list of all groups would mislead."""
    listed = dict(
        re.findall(r"^\s+(\w+): ([\w, ]+)$", auvnn(verb, "--help")[1].partition("choices,")[2], re.M)
    )
    composed = yaml.safe_load((config_dir() / f"{verb}.yaml").read_text(encoding="utf-8"))["defaults"]
    groups = {name for entry in composed if isinstance(entry, dict) for name in entry if "/" not in name}
    assert set(listed) == groups
    for group, members in listed.items():
        assert members.split(", ") == sorted(p.stem for p in (config_dir() / group).glob("*.yaml"))
