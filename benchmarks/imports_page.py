"""The page of benchmarks/imports.py: results beside the judgements on them."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

# right: the twin and what is said of it are; refused: with the true reason; wrong: neither.
JUDGEMENTS = ("right", "refused", "wrong")
UNJUDGED = "to be judged"
HEAD = """# Other people's files

Written by `python -m benchmarks.imports FOLDER` at commit {commit}. Every articulated object of the collections
below goes through import, lint, export, lint of the export, check and replay with default options. The files belong
to their authors and are not in this repository: they lie in Python packages, which
`pip install --no-deps --target FOLDER NAME==VERSION` unpacks. A file is taken when it lies where its collection keeps
objects and has a hinge or a slide, in itself or in what it includes; robots are left out.

Every result was judged by eye once, with pictures of source and export at both ends of each range (`--sheets`) and with
the ranges in the source. *right*: the twin is right, and what the verbs say about it is true. *refused*: import fails
and says the true reason. *wrong*: anything else. `benchmarks/imports.toml` holds the judgements, each for one result of
one file. *to be judged*: the file or its result is another one since.
"""


def result_of(row: Mapping[str, Any]) -> str:
    """The name of a result: a digest of the file and of all that the verbs said."""
    text = json.dumps([row["digest"], row["steps"]], sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def judgement_of(row: Mapping[str, Any], told: Mapping[str, Any]) -> tuple[str, str]:
    """The judgement on a row and why. Raises ValueError for a word that is none."""
    judged = told.get("file", {}).get(row["name"])
    if judged is None or judged["result"] != result_of(row):
        return UNJUDGED, ""
    if judged["judgement"] not in JUDGEMENTS:
        raise ValueError(f"{row['name']}: {judged['judgement']!r} is none of {', '.join(JUDGEMENTS)}")
    return judged["judgement"], judged["because"]


def page(rows: Sequence[Mapping[str, Any]], told: Mapping[str, Any], commit: str) -> tuple[str, bool]:
    """The page, and whether every row is judged and none is wrong."""
    verdicts = {row["name"]: judgement_of(row, told) for row in rows}
    words = [*JUDGEMENTS, UNJUDGED]
    lines = [
        HEAD.format(commit=commit),
        "| collection | version | files | " + " | ".join(words) + " |",
        "|---" * 7 + "|",
    ]
    for name, collection in told["collection"].items():
        top = collection["objects"].partition("/")[0]
        counts = Counter(v for n, (v, _) in verdicts.items() if n.startswith(f"{top}/"))
        packages = ", ".join(f"`{p}`" for p in collection["packages"])
        cells = [
            f"{name}: {packages}",
            collection["version"],
            sum(counts.values()),
            *(counts[w] for w in words),
        ]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    for row in rows:
        verdict, because = verdicts[row["name"]]
        why = f": {because}" if because else ""
        made = f", made at {row['commit']}" if row.get("commit", commit) != commit else ""
        lines += ["", f"## {row['name']}", "", f"**{verdict}**{why} (result `{result_of(row)}`{made})", ""]
        lines += [f"- {step}: {line}" for step, line in row["steps"].items()]
    whole = all(verdict in ("right", "refused") for verdict, _ in verdicts.values())
    return "\n".join(lines) + "\n", whole
