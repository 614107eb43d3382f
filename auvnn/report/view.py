"""One answer, looked at without knowing its class: attributes first, the JSON answer behind them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# What a description in plain data is called by, the first that is there.
_NAMES = ("name", "scheme", "form", "path")


class View:
    """Read-only access to what an answer may or may not have.

    Args:
        answer: an object with attributes and `to_dict()`, or a plain mapping.
        more: what is known besides, for what the answer itself lacks.
    """

    def __init__(self, answer: Any, **more: Any) -> None:
        """Keep the answer; its JSON is asked for when first needed."""
        self.answer = answer
        self._more = more
        self._data: Mapping[str, Any] | None = None

    @property
    def data(self) -> Mapping[str, Any]:
        """The JSON answer as plain data, empty where there is none."""
        if self._data is None:
            try:
                found = self.answer if isinstance(self.answer, Mapping) else self.answer.to_dict()
            except Exception:
                # The attributes may still say enough for a page; writing the JSON reports the fault itself.
                found = {}
            self._data = found if isinstance(found, Mapping) else {}
        return self._data

    def get(self, name: str, default: Any = None) -> Any:
        """Return the attribute `name`, else the key `name` of the JSON answer, else the default.

        What is None counts as absent, and so does a method.
        """
        value = None if isinstance(self.answer, Mapping) else getattr(self.answer, name, None)
        if value is None or _is_method(value):
            value = self.data.get(name, self._more.get(name))
        return default if value is None else value

    def mapping(self, name: str) -> Mapping[str, Any]:
        """Return a mapping, empty where there is none."""
        value = self.get(name)
        if hasattr(value, "to_dict") and not isinstance(value, Mapping):
            value = value.to_dict()
        return value if isinstance(value, Mapping) else {}

    def items(self, name: str) -> list[Any]:
        """Return a list, empty where there is none."""
        value = self.get(name)
        return list(value) if isinstance(value, (list, tuple)) else []

    def texts(self, name: str) -> list[str]:
        """Return a list of texts, empty where there is none."""
        return [str(item) for item in self.items(name)]

    def text(self, name: str, default: str = "") -> str:
        """Return something as text: a name where it has one."""
        value = self.get(name)
        if not isinstance(value, (str, int, float)):
            # An answer may hold a model where its JSON has the model's name.
            value = self.data.get(name, value)
        return name_of(value, default)


def name_of(value: Any, default: str = "") -> str:
    """Return what to call something: itself if it is text, its `name`, or the names of its members."""
    if value is None:
        return default
    if isinstance(value, (list, tuple)):
        return ", ".join(name_of(v) for v in value)
    if isinstance(value, Mapping):
        return name_of(next((value[k] for k in _NAMES if value.get(k)), None), default)
    if isinstance(value, (str, int, float)):
        return str(value)
    name = getattr(value, "name", None)
    return name if isinstance(name, str) and name else default or type(value).__name__


def _is_method(value: Any) -> bool:
    return hasattr(value, "__self__") and callable(value)
