"""`auvnn completion bash|zsh|fish`: a script that completes verbs, keys, effects, vehicles and members of configs.

The lists stand in the script, so that the shell answers at once without starting Python; print it again after an update.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from auvnn.cli.verbs import VERBS
from auvnn.config import config_dir
from auvnn.errors import ConfigError

SHELLS = ("bash", "zsh", "fish")
# Words in the place of a verb that only say something.
PAGES = ("effects", "docs", "completion", "version", "help")
FLAGS = ("--help", "--cfg", "--multirun", "--config-dir", "--jobs")
# Keys whose values are names of effects, alone or in a list.
EFFECTS = ("effect", "effects", "hidden", "candidates")
# Keys that name files; whatever else has no list of values is completed as a file, too.
FILES = ("log", "test", "mapping", "out", "file")


def completion(words: Sequence[str]) -> str:
    """Return the script of one shell.

    Raises:
        ConfigError: no shell is named, or one that is not known.
    """
    if len(words) != 1 or words[0] not in SHELLS:
        raise ConfigError(
            f'auvnn completion takes one of {", ".join(SHELLS)}, for example: eval "$(auvnn completion bash)"'
        )
    keys, values = tables()
    return {"bash": _bash, "zsh": _zsh, "fish": _fish}[words[0]](keys, values)


def tables() -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Return each verb's keys, and the values that are known of each key."""
    from auvnn.docs import page_names
    from auvnn.effects import EFFECTS as CATALOGUE

    folder = config_dir()
    keys: dict[str, list[str]] = {}
    values: dict[str, list[str]] = {}
    for verb in VERBS.names():
        path = folder / f"{verb}.yaml"
        keys[verb] = sorted(_keys(folder, path, values)) if path.is_file() else []
    effects = CATALOGUE.names()
    values |= {key: effects for key in EFFECTS}
    values["model"] = sorted(path.stem for path in (folder / "vehicle").glob("*.yaml"))
    values["vehicle"] = values["model"]
    keys |= {page: [] for page in PAGES}
    values["@effects"], values["@docs"], values["@completion"] = [*effects, "all"], page_names(), list(SHELLS)
    return keys, values


def _keys(folder: Path, path: Path, values: dict[str, list[str]]) -> set[str]:
    """Return the keys of one config file and of those that it takes in; note what each of them can be."""
    # Our own files, read without Hydra, which takes a second to load.
    data: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    found: set[str] = set()
    for entry in data.pop("defaults", None) or ():
        if isinstance(entry, str) and entry.startswith("options/"):
            found |= _keys(folder, folder / f"{entry}.yaml", values)
        elif isinstance(entry, dict):
            for group in entry:
                name = str(group).removeprefix("optional ").split("@")[0]
                if not name.startswith("override") and (folder / name).is_dir():
                    found.add(name)
                    values[name] = sorted(p.stem for p in (folder / name).glob("*.yaml"))
    for key, value in data.items():
        if key != "hydra":
            found.add(str(key))
            if isinstance(value, bool):
                values.setdefault(str(key), ["true", "false"])
    return found


def _case(table: dict[str, list[str]], indent: str = "    ") -> str:
    return "\n".join(f'{indent}{name}) echo "{" ".join(words)}" ;;' for name, words in sorted(table.items()))


_HEAD = "# Completion of auvnn for {shell}, made by: auvnn completion {shell}"

_FUNCTIONS = """\
_auvnn_keys() {{
  case "$1" in
{keys}
  esac
}}
_auvnn_values() {{
  case "$1" in
{values}
  esac
}}"""


def _functions(keys: dict[str, list[str]], values: dict[str, list[str]]) -> str:
    return _FUNCTIONS.format(keys=_case(keys), values=_case(values))


def _bash(keys: dict[str, list[str]], values: dict[str, list[str]]) -> str:
    verbs, flags = " ".join(keys), " ".join(FLAGS)
    return f"""\
{_HEAD.format(shell="bash")}
# Put this into ~/.bashrc:  eval "$(auvnn completion bash)"
{_functions(keys, values)}
_auvnn() {{
  local line="${{COMP_LINE:0:COMP_POINT}}" cur key value list last kept word
  local -a words
  read -r -a words <<< "$line"
  case "$line" in *[[:space:]]) words+=("") ;; esac
  cur="${{words[${{#words[@]}}-1]}}"
  COMPREPLY=()
  if (( ${{#words[@]}} <= 2 )); then
    COMPREPLY=( $(compgen -W "{verbs} --help --version" -- "$cur") )
    return
  fi
  case "${{words[1]}}" in
    effects|docs|completion)
      COMPREPLY=( $(compgen -W "$(_auvnn_values "@${{words[1]}}")" -- "$cur") )
      return ;;
  esac
  case "$cur" in
    -*) COMPREPLY=( $(compgen -W "{flags}" -- "$cur") ) ;;
    *=*)
      key="${{cur%%=*}}" value="${{cur#*=}}"
      list="$(_auvnn_values "$key")"
      # Of a list [a,b the last name is completed, and what stands before it kept.
      last="${{value##*[\\[,]}}" kept="${{value%"$last"}}"
      for word in $(compgen -W "$list" -- "$last"); do COMPREPLY+=( "$kept$word" ); done
      case "$list" in
        ""|*bluerov2*)
          # Only of files: in keys it would escape the equals sign.
          compopt -o filenames 2>/dev/null
          while IFS= read -r word; do COMPREPLY+=( "$word" ); done < <(compgen -f -- "$value") ;;
      esac
      # bash takes = for the end of a word unless it has been told otherwise.
      case "$COMP_WORDBREAKS" in *=*) ;; *) COMPREPLY=( "${{COMPREPLY[@]/#/$key=}}" ) ;; esac ;;
    *)
      COMPREPLY=( $(compgen -S = -W "$(_auvnn_keys "${{words[1]}}")" -- "$cur") )
      compopt -o nospace 2>/dev/null ;;
  esac
}}
complete -o bashdefault -F _auvnn auvnn"""


def _zsh(keys: dict[str, list[str]], values: dict[str, list[str]]) -> str:
    return f"""\
#compdef auvnn
{_HEAD.format(shell="zsh")}
# Put this into ~/.zshrc, after compinit:  eval "$(auvnn completion zsh)"
{_functions(keys, values)}
_auvnn() {{
  local cur="${{words[CURRENT]}}" key list
  if (( CURRENT == 2 )); then
    compadd -- {" ".join(keys)} --help --version
    return
  fi
  case "${{words[2]}}" in
    effects|docs|completion) compadd -- ${{=$(_auvnn_values "@${{words[2]}}")}}; return ;;
  esac
  if [[ "$cur" == -* ]]; then
    compadd -- {" ".join(FLAGS)}
  elif [[ "$cur" == *=* ]]; then
    key="${{cur%%=*}}"
    list="$(_auvnn_values "$key")"
    compset -P '*='
    compset -P '*[\\[,]'
    [[ -n "$list" ]] && compadd -S '' -- ${{=list}}
    [[ -z "$list" || "$list" == *bluerov2* ]] && _files
  else
    compadd -S '=' -- ${{=$(_auvnn_keys "${{words[2]}}")}}
  fi
}}
compdef _auvnn auvnn"""


def _fish(keys: dict[str, list[str]], values: dict[str, list[str]]) -> str:
    def switch(name: str, table: dict[str, list[str]]) -> str:
        cases = "\n".join(
            f"    case {k}\n      printf '%s\\n' {' '.join(v)}" for k, v in sorted(table.items()) if v
        )
        return f"function {name}\n  switch $argv[1]\n{cases}\n  end\nend"

    return f"""\
{_HEAD.format(shell="fish")}
# Put this into ~/.config/fish/config.fish:  auvnn completion fish | source
{switch("__auvnn_keys", keys)}
{switch("__auvnn_values", values)}
function __auvnn_complete
  set -l words (commandline -opc)
  set -l cur (commandline -ct)
  if test (count $words) -lt 2
    printf '%s\\n' {" ".join(keys)} --help --version
    return
  end
  if contains -- $words[2] effects docs completion
    __auvnn_values @$words[2]
    return
  end
  if string match -q -- '-*' $cur
    printf '%s\\n' {" ".join(FLAGS)}
  else if string match -q -- '*=*' $cur
    set -l key (string split -m 1 = -- $cur)[1]
    set -l value (string split -m 1 = -- $cur)[2]
    set -l kept (string match -r -- '^.*[\\[,]' $value)
    set -l list (__auvnn_values $key)
    for word in $list
      echo "$key=$kept$word"
    end
    if test (count $list) -eq 0; or contains -- bluerov2 $list
      for path in (__fish_complete_path $value)
        echo "$key=$path"
      end
    end
  else
    for key in (__auvnn_keys $words[2])
      echo $key=
    end
  end
end
complete -c auvnn -f -a '(__auvnn_complete)'"""
