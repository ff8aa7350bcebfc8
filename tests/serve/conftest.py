"""Fixtures of the page's tests; without the extra [serve] each file skips itself by `serving`."""

from importlib.util import find_spec

if find_spec("starlette") and find_spec("uvicorn"):
    from serving import _path, client, desk

    __all__ = ["_path", "client", "desk"]
