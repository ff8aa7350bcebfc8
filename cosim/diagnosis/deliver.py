"""Where scripts written for 0.1.0 look for `as_json`: it lives in `cosim.delivery.deliver`."""

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    return getattr(import_module("cosim.delivery.deliver"), name)
