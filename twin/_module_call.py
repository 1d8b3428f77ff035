"""Lets `twin.export(...)` and `twin.check(...)` be called although both are also modules with contents of their own."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


def call_as(module: str, function: str) -> None:
    """Make calling the module `module` call its `function` (by the documented way of setting a module's class)."""

    class CallableModule(ModuleType):
        def __call__(self, *args: Any, **kwargs: Any) -> Any:
            return getattr(self, function)(*args, **kwargs)

    sys.modules[module].__class__ = CallableModule
