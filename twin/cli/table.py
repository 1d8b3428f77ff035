"""What the command line names and imports only when called: twin knows neither reconstruction nor robots.

These are the only functions that are named by text; tests/twin/cli/test_cli.py resolves each.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

# verb -> (function that carries it out, what it does). Named as strings: their imports take seconds.
VERBS = {
    "demo": ("twin.cli.verbs:demo", "the whole chain on the recording shipped with Funtwin"),
    "simulate": ("recon.verbs.twins:simulate", "render a recording with exact truth from an MJCF scene"),
    "inspect": (
        "recon.verbs.recordings:inspect",
        "say what is wrong with a recording, and how to record better",
    ),
    "convert": ("recon.verbs.recordings:convert", "write a recording of any layout as one of ours"),
    "calibrate": (
        "recon.verbs.recordings:calibrate",
        "find a camera's lens, and where its depth camera stands, from pictures of a board",
    ),
    "reconstruct": ("recon.verbs.twins:reconstruct", "turn a recording into a twin"),
    "import": ("twin.cli.verbs:import_scene", "turn a URDF or MJCF scene from elsewhere into a twin"),
    "export": ("twin.cli.verbs:export", "write the twin as URDF, MJCF and USD"),
    "check": (
        "twin.cli.verbs:check",
        "load the exported files in other programs and compare them with the twin",
    ),
    "lint": ("twin.cli.verbs:lint", "find faults that readers don't report in URDF, MJCF and USD files"),
    "replay": ("robots.replay_verb:replay", "let a robot open or close the twin's parts in simulation"),
    "trajectory": ("robots.trajectory_verb:trajectory", "export a planned trajectory in robots' own formats"),
    "evaluate": ("recon.verbs.twins:evaluate", "compare a run with the truth"),
    "annotate": (
        "recon.verbs.annotate:annotate",
        "mark in a browser what truly happens in a recording, as a truth for evaluate",
    ),
    "batch": (
        "twin.cli.batch_verb:batch",
        "take many recordings through the verbs, on all cores or machines; go on where it stopped",
    ),
    "config": ("twin.cli.config_verb:config", "list the settings with unit, range and meaning"),
    "view": (
        "twin.cli.view_verb:view",
        "show the twin in a browser, and put right there what was found wrong",
    ),
    "edit": (
        "twin.cli.edit_verb:edit",
        "change what was found: limits, axis, closed end, names, parts, verdicts; or take it back",
    ),
    "physics": (
        "twin.cli.physics_verbs:physics",
        "show, set or estimate what parts weigh and how they resist",
    ),
    "doctor": ("twin.cli.verbs:doctor", "say what this machine lacks, and how to get it"),
    "robots": (
        "robots.verbs:robots",
        "list or show the robots that can open parts, or fetch a model from the net",
    ),
    "engines": (
        "twin.cli.verbs:engines",
        "list or install the programs that judge exports in environments of their own",
    ),
    "completion": (
        "twin.cli.completion_verb:completion",
        "print a script that completes `twin` in your shell",
    ),
}
# What `twin demo` chains, beside the twin's own verbs.
CHAIN = {
    "resolve": "robots:resolve",
    "open_recording": "recon.readers:open_recording",
    "reconstruct": "recon.verbs.twins:reconstruct_step",
    "evaluate": "recon.verbs.twins:evaluate_step",
    "replay": "robots.replay_verb:replay_step",
}
# verb -> class of its settings.
SETTINGS = {
    "reconstruct": "recon.config:ReconConfig",
    "simulate": "recon.simulate.config:SimulateConfig",
    "export": "twin.exporters.config:ExportConfig",
    "check": "twin.verification.config:CheckConfig",
    "replay": "robots.config:RobotsConfig",
}
# option, alone or after a verb -> the names that it takes, for completion in a shell.
WORDS = {
    "--robot": "robots.model.catalog:names",
    "--layout": "recon.readers:READERS",
    "--engines": "twin.verification:ENGINES",
    "--install": "twin.engines:ENGINES",
    "--ignore": "twin.lint.rules:RULES",
    "robots": "robots.model.catalog:names",
    "trajectory --format": "robots.formats:FORMATS",
}
# Frames for a robot's film and for a question about a part; the caller does not know how recordings are read.
OPEN_RECORDING = "recon.readers:open_recording"
TRACKS_SEEN = "recon.verbs.of_tracks:tracks_seen"


def named(name: str) -> Any:
    """The object "module:attribute"."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)
