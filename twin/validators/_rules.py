"""Run in another interpreter: python _rules.py ANSWER.json FILE.usd...; needs pxr, nothing of this package.

The answer is a list of {validator, severity, rule, message, file, where}.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pxr import Sdf, Sdr, Tf, Usd, UsdValidation

_SHADERS = "usdShadeValidators:ShaderSdrCompliance"


def openusd(files: list[str]) -> list[dict[str, str]]:
    """OpenUSD's validators, but that of shaders if this build of USD lacks the definitions of its shaders."""
    try:
        known = bool(Sdr.Registry().GetShaderNodeByIdentifier("UsdPreviewSurface"))
    except Tf.ErrorException:
        known = False
    chosen = [
        v
        for v in UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
        if known or v.GetMetadata().name != _SHADERS
    ]
    severities = {
        UsdValidation.ValidationErrorType.Error: "error",
        UsdValidation.ValidationErrorType.Warn: "warning",
    }
    rows = []
    for file in files:
        stage = Usd.Stage.Open(file)
        for e in UsdValidation.ValidationContext(chosen).Validate(stage):
            sites = ", ".join(str(s.GetProperty().GetPath() if s.GetProperty() else s.GetPrim().GetPath()) for s in e.GetSites() if s.IsPrim() or s.IsProperty())  # fmt: skip
            rule = f"{e.GetValidator().GetMetadata().name}.{e.GetName()}" if e.GetValidator() else e.GetName()
            rows.append(
                _row("openusd", severities.get(e.GetType(), "info"), rule, e.GetMessage(), file, sites)
            )
    return rows


def nvidia(files: list[str]) -> list[dict[str, str]]:
    """NVIDIA's general rules; those that other packages add are left to the profile."""
    import usd_validation_nvidia as nv

    engine = nv.ValidationEngine(init_rules=False, variants=False)
    for rule in nv.CategoryRuleRegistry().rules:
        if rule.__module__.startswith("usd_validation_nvidia."):
            engine.enable_rule(rule)
    severities = {"ERROR": "error", "FAILURE": "error", "WARNING": "warning"}
    rows = []
    for file in files:
        for stage in _variants(file):
            for i in engine.validate(stage).issues():
                severity = severities.get(i.severity.name, "info")
                rule = i.rule.__name__ if i.rule else ""
                rows.append(_row("nvidia", severity, rule, i.message, file, i.at.as_str() if i.at else ""))
    return rows


def _variants(file: str) -> Iterator[Usd.Stage]:
    """The stage as it is, then with every other variant of the file's own sets, one at a time: all
    combinations of an asset's runtimes would take minutes and say the same."""
    stage = Usd.Stage.Open(file)
    yield stage
    prim = stage.GetDefaultPrim()
    spec = stage.GetRootLayer().GetPrimAtPath(prim.GetPath()) if prim else None
    for name in spec.variantSets.keys() if spec else ():
        variants = prim.GetVariantSets().GetVariantSet(name)
        for option in variants.GetVariantNames():
            if option == variants.GetVariantSelection():
                continue
            other = Usd.Stage.Open(stage.GetRootLayer(), Sdf.Layer.CreateAnonymous())
            with Usd.EditContext(other, other.GetSessionLayer()):
                other.GetDefaultPrim().GetVariantSets().GetVariantSet(name).SetVariantSelection(option)
            yield other


def _row(validator: str, severity: str, rule: str, message: str, file: str, where: str) -> dict[str, str]:
    name = "/".join(Path(file).parts[-2:])  # an asset's interface is called like the stage that refers to it
    return {
        "validator": validator, "severity": severity, "rule": rule, "message": message, "file": name, "where": where,
    }  # fmt: skip


def main(answer: str, *files: str) -> None:
    """Write what all validators say, each finding once."""
    rows: list[dict[str, Any]] = openusd(list(files))
    if find_spec("usd_validation_nvidia"):
        rows += nvidia(list(files))
    unique = list({tuple(r.items()): r for r in rows}.values())
    Path(answer).write_text(json.dumps(unique), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
