"""What public functions take for a path: a text as well as a Path. Each makes a Path of it in its first line."""

from __future__ import annotations

import os

AnyPath = str | os.PathLike[str]
