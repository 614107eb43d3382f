"""Effects of one's own at run time: a class or an instance wherever a name goes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, overload

from auvnn.effects import EFFECTS, effect_class
from auvnn.effects.base import Effect
from auvnn.errors import ConfigError


def register_effect(kind: type[Effect]) -> type[Effect]:
    """Add a class to the catalogue of effects of this process; also a decorator.

    From then on its `name` goes wherever the name of an effect goes: `diagnose`, `add`, `improve`, `simulate(hidden=)`,
    `remove`, model files. A model that holds it is saved by name and loaded again wherever it is registered. Other
    processes (`workers=`) know only what packages offer by the entry point `auvnn.effects`.

    Args:
        kind: a subclass of `auvnn.effects.Effect` with `name` and `cause`.

    Returns:
        The class.

    Raises:
        ConfigError: it is no effect, lacks its name or cause, overrides no hook, or another effect has the name.

    Example:
        ```python
        from auvnn.effects import EFFECTS

        auvnn.register_effect(EFFECTS.get("payload"))  # or a class of your own; what is there already stays
        ```
    """
    if not isinstance(kind, type) or not issubclass(kind, Effect):
        raise ConfigError(f"{_called(kind)} is no effect: give a subclass of auvnn.effects.Effect")
    for attribute, example in (("name", "'net_drag'"), ("cause", "'a net that is towed'")):
        value = getattr(kind, attribute, None)
        if not isinstance(value, str) or not value:
            raise ConfigError(
                f"{kind.__name__} has no {attribute}: write {attribute} = {example} in the class"
            )
    if not kind.name.isidentifier():
        raise ConfigError(f"{kind.__name__}.name = {kind.name!r}: use letters, digits and underscores")
    if not kind.hooks():
        raise ConfigError(
            f"{kind.__name__} overrides no hook and so does nothing: write one, for example wrench"
        )
    for attribute, value in (("symbol", kind.name), ("reference", f"{kind.__module__}.{kind.__qualname__}")):
        if not hasattr(kind, attribute):
            setattr(kind, attribute, value)
    EFFECTS.register(kind.name, kind)
    return kind


def name_of(effect: Any) -> str:
    """Return the name of an effect given as a name, a class or an instance; a class not known yet is registered.

    Raises:
        ConfigError: it is none of these.
    """
    if isinstance(effect, str):
        return effect
    kind = type(effect) if isinstance(effect, Effect) else effect
    if not isinstance(kind, type) or not issubclass(kind, Effect):
        raise ConfigError(f"{_called(effect)} is no effect: give its name, its class or an instance")
    name = getattr(kind, "name", None)
    try:
        known = effect_class(name) if isinstance(name, str) else None
    except ConfigError:
        known = None
    if known is not kind:
        register_effect(kind)
    return str(kind.name)


@overload
def names_of(effects: None) -> None: ...
@overload
def names_of(effects: str | Effect | type[Effect] | Iterable[Any]) -> str | list[str]: ...
def names_of(effects: Any) -> str | list[str] | None:
    """Return names in the place of classes and instances; a list keeps its kind, one effect stays one.

    Raises:
        ConfigError: something in it is no effect.
    """
    if effects is None or isinstance(effects, str):
        return effects
    if isinstance(effects, (type, Effect)):
        return name_of(effects)
    if isinstance(effects, list) and all(isinstance(e, str) for e in effects):
        return effects
    return [name_of(e) for e in effects]


def values_of(effects: Any) -> dict[str, Any]:
    """Return what stands for effects with their values: an instance has its own, a class or a name none.

    Args:
        effects: a name, a class, an instance, a list of these, a mapping from names or classes to values, or None.
    """
    if effects is None:
        return {}
    if isinstance(effects, str):
        return {effects: None}
    if isinstance(effects, Mapping):
        return {name_of(k): v for k, v in effects.items()}
    members = [effects] if isinstance(effects, (type, Effect)) else list(effects)
    return {name_of(e): e.values() if isinstance(e, Effect) else None for e in members}


def _called(value: Any) -> str:
    return value.__name__ if isinstance(value, type) else repr(value)[:80]
