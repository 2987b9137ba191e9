"""Python values as TOML, and settings as tables of a study."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from os import PathLike, fspath
from typing import Any, ClassVar

import numpy as np


@dataclass(frozen=True)
class Kind:
    """Settings that are a table of a study, with the key ``kind`` and one key for each field."""

    kind: ClassVar[str]

    def _table(self) -> dict[str, Any]:
        """The table, as a dict."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {"kind": self.kind} | {
            name: value._table() if isinstance(value, Kind) else value for name, value in values.items()
        }


def value(given: Any) -> str:
    """A value as it stands behind the equals sign."""
    if isinstance(given, (np.generic, np.ndarray)):
        given = given.tolist()
    if isinstance(given, bool):
        return "true" if given else "false"
    if isinstance(given, (int, float)):
        return repr(given)
    if isinstance(given, PathLike):
        given = fspath(given)
    if isinstance(given, str):
        return json.dumps(given, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(given, Mapping):
        return "{ " + ", ".join(f"{key(k)} = {value(v)}" for k, v in given.items() if v is not None) + " }"
    if isinstance(given, Sequence):
        return "[" + ", ".join(value(v) for v in given) + "]"
    raise TypeError(f"a study has numbers, texts, lists and tables, but no {type(given).__name__}: {given!r}")


def key(name: Any) -> str:
    """A bare key where it can be."""
    if not isinstance(name, str):
        raise TypeError(f"a key of a study is a text, not {name!r}")
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else value(name)


def document(tables: Mapping[str, Any]) -> str:
    """A study: its tables one after the other, one key a line."""
    plain = [f"{key(k)} = {value(v)}" for k, v in tables.items() if not isinstance(v, Mapping) and v is not None]
    for name, table in tables.items():
        if isinstance(table, Mapping):
            lines = [f"{key(k)} = {value(v)}" for k, v in table.items() if v is not None]
            plain += [f"[{key(name)}]", *lines]
    return "\n".join(plain) + "\n"
