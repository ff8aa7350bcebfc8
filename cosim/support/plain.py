"""Plain data: what JSON and TOML can hold."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

Json: TypeAlias = "bool | int | float | str | Sequence[Json] | Mapping[str, Json] | None"
"""Anything that JSON can hold."""
JsonObject: TypeAlias = dict[str, Json]
"""An object that is written as JSON."""
Parsed: TypeAlias = dict[str, Any]
"""An object as it came out of a JSON or TOML file: nothing of it is known until it is checked."""
