"""Text in columns."""

from __future__ import annotations

from collections.abc import Collection, Sequence


def aligned(lines: Sequence[Sequence[str]], right: Collection[int] = ()) -> list[str]:
    """Lines of cells, each column as wide as its widest cell; those in `right` end at their right."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return [
        "  ".join(
            w.rjust(n) if k in right else w.ljust(n)
            for k, (w, n) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
