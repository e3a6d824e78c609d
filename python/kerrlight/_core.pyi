"""The compiled half of the package; its callers in this folder say what everything means, and have types."""

from typing import Any

__version__: str

def __getattr__(name: str) -> Any: ...
