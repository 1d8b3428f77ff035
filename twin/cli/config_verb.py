"""The verb `twin config`: every setting with its value, unit, range and meaning, and what gives the value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from twin.cli import given
from twin.cli.console import Console, Outcome
from twin.cli.step import run_folder
from twin.cli.table import SETTINGS, named
from twin.errors import InputError
from twin.files.text import read_json
from twin.report.sections import Table
from twin.runs.settings import as_dict, from_dict, load_config, to_toml
from twin.runs.settings_list import Group, Listed, groups, listed

_COLUMNS = ["setting", "value", "allowed", "from", "meaning"]


def config(
    console: Console,
    run: Path | None,
    what: str,
    config: Path | None,
    set: Sequence[str],
    changed: bool = False,
    toml: bool = False,
) -> Outcome:
    """Settings as a verb would take them with these options, or those that a run was made with."""
    if run is not None and (config or set or what != "reconstruct"):
        raise InputError(f"{run} has its own settings", "leave out --of, --config and --set, or the run")
    with console.progress():  # importing the stages takes seconds
        cls = named(SETTINGS[what])
    if run is None:
        settings, sources = given.settings(cls, config, set), given.sources(config, set)
    else:
        settings = _of_run(cls, run)
        sources = {s.path: str(run) for s in listed(settings) if s.changed}
    if toml:
        notes = {s.path: comment(s) for s in listed(settings)}
        text = to_toml(settings, notes.__getitem__)
        return Outcome({"toml": text}, notes=[text.rstrip("\n")])
    return _outcome(what, settings, sources, changed)


def comment(s: Listed) -> str:
    """Meaning, range, unit and default in one line."""
    allowed = f"{s.allowed}; " if s.allowed else ""
    return f"{s.rule.meaning} [{allowed}default {s.text(s.default)}]"


def _of_run(cls: type[Any], run: Path) -> Any:
    """What RUN/config.toml says, or where only twin/ was kept, the twin itself."""
    folder = run_folder(run)
    if not folder.is_dir():
        raise InputError(f"{run} does not exist", "give a run folder, or none for the defaults")
    if (folder / "config.toml").is_file():
        return load_config(cls, folder / "config.toml")
    document = folder / "twin" / "twin.json"
    noted = read_json(document).get("provenance", {}).get("config")
    if not isinstance(noted, Mapping):
        raise InputError(
            f"{run} tells no settings: neither config.toml nor twin/twin.json has them",
            "give the folder of a run that `twin reconstruct` made",
        )
    return from_dict(cls, noted, str(document))


def _outcome(what: str, settings: Any, sources: Mapping[str, str], only_changed: bool) -> Outcome:
    def source(s: Listed) -> str:
        return sources.get(s.path, "default")

    def rows(group: Group) -> list[list[str]]:
        return [
            [
                s.name,
                s.text(s.value),
                s.allowed,
                f"{source(s)} (default {s.text(s.default)})" if s.changed else source(s),
                s.rule.meaning,
            ]
            for s in group.settings
            if s.changed or not only_changed
        ]

    tables = [
        Table(f"{g.path or what}: {g.meaning}".rstrip(": "), _COLUMNS, found)
        for g in groups(settings)
        if (found := rows(g))
    ]
    others = [s.path for s in listed(settings) if s.changed]
    data = [_data(s, source(s)) for s in listed(settings) if s.changed or not only_changed]
    counted = f"{len(others)} of {len(listed(settings))} settings differ from today's defaults"
    note = f"{counted}: {', '.join(others)}" if others else counted
    return Outcome({"of": what, "settings": data, "changed": others}, tables, [note])


def _data(s: Listed, source: str) -> dict[str, Any]:
    return {
        "name": s.path,
        "value": as_dict(s.value),
        "default": as_dict(s.default),
        "unit": s.rule.unit,
        "range": s.rule.range,
        "source": source,
        "meaning": s.rule.meaning,
    }
