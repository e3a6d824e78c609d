"""Settings as Python has them, scenes, dictionaries or paths, and as TOML."""

from __future__ import annotations

import json
import math
import os
from dataclasses import fields, is_dataclass
from os import PathLike, fspath
from typing import Any, Iterator, Mapping, Protocol, Union

import numpy as np

from kerrlight import _core
from kerrlight._arrays import degrees
from kerrlight.flow import Infall, Keplerian, PowerLaw, Profile, Tabulated


class Tables(Protocol):
    """Settings as objects, such as a ``Scene``."""

    def to_dict(self) -> dict[str, Any]:
        """The tables of a file."""


Settings = Union[None, str, "PathLike[str]", Mapping[str, Any], Tables]
"""A dictionary, TOML text, the path of a file, a scene as objects, or nothing: what is built in."""


def _plain(value: Any) -> Any:
    """Numbers and arrays of numpy for the encoder of JSON."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, PathLike):
        return fspath(value)
    raise TypeError(f"{value!r} is no setting")


INFINITE = "\0inf"
"""Text for infinity in JSON, which has none."""


def of_json(value: Any) -> Any:
    """What the compiled half has written as JSON, with infinities in place of the words that stand for them."""
    if isinstance(value, dict):
        return {key: of_json(of) for key, of in value.items()}
    if isinstance(value, list):
        return [of_json(of) for of in value]
    if isinstance(value, str) and value.lstrip("-").startswith("\0"):
        return float(value.replace("\0", ""))
    return value


def _table(value: Any) -> Any:
    """Objects such as a ``Hole`` as tables."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(value)
    return value


def _without_none(value: Any, name: str = "") -> Any:
    """Tables without keys that are None; a key with dots leads through tables, as in TOML."""
    value = _table(value)
    if isinstance(value, Mapping):
        table: dict[str, Any] = {}
        for key, of in value.items():
            if of is not None:
                whole_name = f"{name}.{key}" if name else str(key)
                _put(table, str(key).split("."), _without_none(of, whole_name))
        return table
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_without_none(v, f"{name}.{k}") for k, v in enumerate(value)]
    if isinstance(value, (float, np.floating)) and not math.isfinite(value):
        if math.isnan(value):
            raise ValueError(f"{name} = nan is not allowed: a number")
        return INFINITE if value > 0 else f"-{INFINITE}"
    if isinstance(value, (int, float, np.number)) and name.endswith("_deg"):
        degrees(name, value)
    return value


def _put(table: dict[str, Any], keys: list[str], value: Any) -> None:
    for key in keys[:-1]:
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            raise ValueError(f"{'.'.join(keys)}: {key} is a value, not a table")
    here = table.get(keys[-1])
    if isinstance(here, dict) and isinstance(value, dict):
        for key, of in value.items():
            _put(here, [key], of)
    else:
        table[keys[-1]] = value


def text_of(settings: Settings, folder: Union[None, str, PathLike[str]]) -> tuple[str | None, str]:
    """The TOML text of settings, and the folder that relative paths in it start from."""
    if settings is not None and hasattr(settings, "to_dict"):
        settings = settings.to_dict()
    if isinstance(settings, Mapping):
        encoded = json.dumps(_without_none(settings), default=_plain)
        return _core.toml_of_json(encoded), fspath(folder or ".")
    if settings is None:
        return None, fspath(folder or ".")
    if not isinstance(settings, (str, PathLike)):
        kind = type(settings).__name__
        raise TypeError(f"settings are a dictionary, TOML text, the path of a file or a Scene, not {kind}")
    name = fspath(settings)
    if name.lower().endswith(".exr") and "\n" not in name:
        return _core.scene_of_exr(name), fspath(folder or os.path.dirname(name) or ".")
    if isinstance(settings, str) and ("\n" in name or "=" in name):
        return name, fspath(folder or ".")
    with open(name, "rb") as opened:
        data = opened.read()
    try:
        return data.decode("utf-8"), fspath(folder or os.path.dirname(name) or ".")
    except UnicodeDecodeError:
        words = "is no text of settings: give a TOML file, and name data in it"
        raise ValueError(f"{name} {words} (`kerrlight fit --init {name}` writes one for data)") from None


def _flat(changes: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys of all values in dictionaries of dictionaries."""
    for key, of in changes.items():
        value = _table(of)
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value


def overrides_of(changes: Mapping[str, Any] | None) -> list[str]:
    """``key.path=value`` of each change, values as TOML writes them; a dictionary changes the keys that it has, and None
    removes a key."""

    if changes is not None and not isinstance(changes, Mapping):
        raise TypeError(f"set = {changes!r} is not allowed: a dictionary of changes")

    def value(key: str, of: Any) -> str:
        return _core.toml_value_of_json(json.dumps(_without_none(of, key), default=_plain))

    flat = _flat(changes or {})
    return [f"{key}=" if of is None else f"{key}={value(key, of)}" for key, of in flat]


def plain(value: Any) -> Any:
    """Objects as the tables of a file; what is None or an empty list is left out."""
    if isinstance(value, (Keplerian, PowerLaw, Tabulated, Infall, Profile)):
        return value.table()
    if is_dataclass(value) and not isinstance(value, type):
        parts = {part.name: plain(getattr(value, part.name)) for part in fields(value)}
        return {name: part for name, part in parts.items() if part is not None and not (isinstance(part, list) and not part)}
    if isinstance(value, list):
        return [plain(part) for part in value]
    return value
