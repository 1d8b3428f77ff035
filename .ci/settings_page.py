"""Writes docs/settings.md, the tables of all settings, from the classes that hold them: python
.ci/settings_page.py

tests/test_settings_law.py says when the page is out of date.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from twin.cli.table import SETTINGS, named
from twin.runs.settings_list import Group, groups

PAGE = Path(__file__).resolve().parents[1] / "docs" / "settings.md"
ABOUT = {
    "reconstruct": "of `twin reconstruct` and `twin demo`, one table a stage; from Python `recon.ReconConfig`",
    "simulate": "of `twin simulate`; from Python `recon.simulate.SimulateConfig`",
    "export": 'of `twin export`; from Python `twin.export(..., collision={"part_pieces": 8})`',
    "check": "of `twin check`; from Python `twin.check(..., processes=)`",
    "replay": "of `twin replay`; from Python `robots.PlanConfig` and `robots.ReplayConfig`",
}
HEAD = """# Settings

Made by `python .ci/settings_page.py` from the fields of the classes, which hold every value to its type and range.

`twin config` lists the settings of a reconstruction here and now, with what gives each value; `twin config --of replay` those of another
verb; `twin config RUN` those of a run and where they differ from today's defaults; `twin config --toml` prints a file for `--config` with
the meanings as comments, `--json` the same for machines. `--set labels.every=2` changes one setting of a verb, `--config FILE.toml` many:
names have the table's path before a dot, angles are in radians.
"""


def page() -> str:
    """The whole page."""
    return "\n".join([HEAD, *(line for what in SETTINGS for line in _part(what))]).rstrip("\n") + "\n"


def _part(what: str) -> Iterator[str]:
    yield from (f"## {what.capitalize()}", "", f"Settings {ABOUT[what]}.", "")
    for group in groups(named(SETTINGS[what])()):
        if group.path:
            yield from (f"### `{group.path}`: {group.meaning}", "")
        yield from (group.about, "")
        yield from _table(group)


def _table(group: Group) -> Iterator[str]:
    yield from ("| setting | default | allowed | meaning |", "|---|---|---|---|")
    for s in group.settings:
        cells = (f"`{s.name}`", s.text(s.default), s.allowed, s.rule.meaning)
        yield f"| {' | '.join(c.replace('|', chr(92) + '|') for c in cells)} |"
    yield ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
