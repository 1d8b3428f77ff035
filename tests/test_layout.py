"""What the pages say about the code's layout is so: modules exist, stages are the pipeline's, and what they
name is run."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from tests.conftest import ORDER

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
LINKED = [p for folder in (".", "docs", "benchmarks") for p in sorted((ROOT / folder).glob("*.md"))]
MODULE = re.compile(r"`(?P<path>(?:twin|recon|robots)(?:/\w+)*(?:\.py|/)|\w+\.py)`")
# words that the glossary of CONTRIBUTING.md replaced
LEFT = re.compile(
    r"\bslippers?\b|\briders?\b|\brides? on\b|\bhand(s|ed|ing)? over\b|\b(base|body|robot) that walks\b|\bwalkers?\b",
    re.IGNORECASE,
)


def module_of(file: Path) -> ModuleType:
    """A script of the project as a module."""
    spec = spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def stages_of_the_pipeline() -> list[str]:
    """Names of the stages of a clip's reconstruction, in order: those before `survey`, those of it and of an
    interaction, and those after it."""

    def calls(module: str, function: str) -> list[str]:
        tree = ast.parse((ROOT / module.replace(".", "/")).with_suffix(".py").read_text(encoding="utf-8"))
        (body,) = (n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == function)
        found = [
            n
            for n in ast.walk(body)
            if isinstance(n, ast.Call) and ast.unparse(n.func) in {"stage", "of.stage"}
        ]
        ordered = sorted(found, key=lambda c: c.lineno)
        return [getattr(import_module(module), ast.unparse(c.args[0])).name for c in ordered]

    places = (
        ("pipeline", "_run"),
        ("stages.odometry", "odometry"),
        ("stages.survey", "survey"),
        ("interaction.interaction", "interact"),
        ("interaction.interaction", "_solved"),
        ("stages.survey", "_upright"),
        ("pipeline", "_judged_twin"),
    )
    found = [name for module, function in places for name in calls(f"recon.{module}", function)]
    at_times = ("frames", "said")  # which only minutes have, and only the user's word
    return [name for name in dict.fromkeys(found) if name not in at_times]


def files_named(text: str) -> list[str]:
    """Files and folders that a text names in backticks; a file without a folder lies beside the one before
    it."""
    named = [""]
    for found in MODULE.finditer(text):
        folder, _, _ = named[-1].rpartition("/")
        named.append(found["path"] if "/" in found["path"] else f"{folder}/{found['path']}")
    return named[1:]


def table_of_stages() -> list[tuple[str, list[str]]]:
    """(stage, files) of the rows of architecture.md."""
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    table = text.split("| stage | finds | module |")[1].split("\n\n")[0]
    rows = []
    for line in table.splitlines()[2:]:
        stage, _, modules = (c.strip() for c in line.strip("|").split("|"))
        rows.append((stage, files_named(modules)))
    return rows


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_file_that_a_page_names_exists(page: Path) -> None:
    assert [n for n in files_named(page.read_text(encoding="utf-8")) if not (ROOT / n).exists()] == []


def anchors(page: Path) -> set[str]:
    """Anchors that a page's headings get: lower case, hyphens for blanks, other signs left out."""
    prose = re.sub(r"^ *```.*?^ *```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.+)$", prose, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", h.lower()).strip().replace(" ", "-") for h in headings}


def dead_links(page: Path) -> list[str]:
    """Links of a page to files and headings that are not there."""
    dead = []
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        path, _, anchor = link.partition("#")
        to = page.parent / path if path else page
        if "://" not in link and not (to.is_file() and (not anchor or anchor in anchors(to))):
            dead.append(link)
    return dead


@pytest.mark.parametrize("page", LINKED, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    assert dead_links(page) == []


def test_a_dead_link_is_found(tmp_path: Path) -> None:
    (tmp_path / "other.md").write_text("# A heading: `x`, y\n```\n# no heading\n```\n")
    page = tmp_path / "page.md"
    good = "[1](other.md) [2](other.md#a-heading-x-y) [3](#here) [4](https://example.org/x)"
    page.write_text(f"# Here\n{good} [5](gone.md) [6](other.md#no-heading) [7](#there)\n")
    assert dead_links(page) == ["gone.md", "other.md#no-heading", "#there"]


def test_a_dead_link_of_the_built_site_is_found(tmp_path: Path) -> None:
    """`make docs` asks docs/links.py about what was built."""
    links = module_of(ROOT / "docs/links.py")
    good = '<a href="https://example.org/x"></a><a href="api/"></a><a href="api/index.html#f"></a>'
    (tmp_path / "api").mkdir()
    (tmp_path / "api/index.html").write_text('<h2 id="f"></h2>')
    (tmp_path / "index.html").write_text(good)
    assert links.broken(tmp_path) == []
    bad = '<a href="gone.html"></a><a href="api/index.html#g"></a><img src="p.png"><autoref identifier="x.y"></autoref>'
    (tmp_path / "index.html").write_text(good + bad)
    told = sorted(links.broken(tmp_path))
    assert told == [
        "index.html: [x.y] is unresolved",
        "index.html: api/index.html#g leads nowhere",
        "index.html: gone.html leads nowhere",
        "index.html: p.png leads nowhere",
    ]


def test_what_starts_first_exists() -> None:
    assert [name for name in ORDER if not (ROOT / name).exists()] == []


def test_the_table_of_stages_is_the_pipeline() -> None:
    assert [stage for stage, _ in table_of_stages()] == stages_of_the_pipeline()
    text = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    (chain,) = re.findall(r"^recording → (.*) → Twin$", text, re.MULTILINE)
    assert chain.split(" → ") == stages_of_the_pipeline()


def test_the_files_in_the_table_of_stages_are_imported_by_the_pipeline() -> None:
    """A file that nothing of the chain imports is not part of it, whatever a page says."""
    code = "import sys, recon.pipeline; print(*[m for m in sys.modules if m.startswith('recon')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    imported = set(done.stdout.split())
    named = [f for _, files in table_of_stages() for f in files]
    assert len(named) >= 9
    assert [f for f in named if f.removesuffix(".py").replace("/", ".") not in imported] == []


def test_a_file_without_a_folder_lies_beside_the_one_before_it() -> None:
    assert files_named("`recon/interaction/labels/` `crf.py` and `twin/scene.py`, `joint.py`") == [
        "recon/interaction/labels/",
        "recon/interaction/labels/crf.py",
        "twin/scene.py",
        "twin/joint.py",
    ]


def test_words_that_the_glossary_replaced_do_not_come_back() -> None:
    kinds = [
        p
        for folder in ("twin", "recon", "robots", "tests", "benchmarks", "docs")
        for p in (ROOT / folder).rglob("*.py")
    ]
    texts = [p for p in (*kinds, *LINKED) if p.name not in ("CHANGELOG.md", Path(__file__).name)]
    assert len(texts) > 300
    found = {
        f"{p.relative_to(ROOT)}: {m[0]}" for p in texts for m in LEFT.finditer(p.read_text(encoding="utf-8"))
    }
    assert sorted(found) == []


def sections_of_the_method() -> list[tuple[str, str]]:
    """(section of the paper's supplement, module) by docs/method.md; a folder stands for its __init__.py."""
    rows = (
        (ROOT / "docs/method.md").read_text(encoding="utf-8").split("|---|---|---|---|\n")[1].split("\n\n")[0]
    )
    found = []
    for step, here, *_ in (row.strip("|").split("|") for row in rows.splitlines()):
        if section := re.search(r"supplement \d(?:\.\d)?(?:, (?:below )?eq\. \d(?: and \d)?)?", step):
            found += [(section[0], f + "__init__.py" if f.endswith("/") else f) for f in files_named(here)]
    return found


@pytest.mark.parametrize(("section", "module"), sections_of_the_method())
def test_a_module_names_the_section_that_it_stands_for(section: str, module: str) -> None:
    said = ast.get_docstring(ast.parse((ROOT / module).read_text(encoding="utf-8"))) or ""
    assert f"FunREC, {section}:" in said


def test_every_section_of_the_method_is_described() -> None:
    told = {section.split(",")[0] for section, _ in sections_of_the_method()}
    assert told >= {f"supplement {n}" for n in ("1.1", "1.2", "1.3", "1.4", "3.2", "4")}


def test_the_top_of_recon_is_one_screen() -> None:
    listed = subprocess.run(["git", "ls-files", "recon"], capture_output=True, text=True, cwd=ROOT)
    if listed.returncode:
        pytest.skip("not a git checkout")
    assert len({line.split("/")[1] for line in listed.stdout.splitlines()}) <= 24


def test_benchmarks_stand_without_the_tests() -> None:
    pattern = re.compile(r"^\s*(?:from|import) tests\b", re.MULTILINE)
    files = sorted((ROOT / "benchmarks").rglob("*.py"))
    assert len(files) > 20
    assert [f.name for f in files if pattern.search(f.read_text(encoding="utf-8"))] == []


def test_no_test_replaces_a_private_constant() -> None:
    """Such a test passes whatever reads the constant; a parameter or behaviour is tested instead."""
    pattern = re.compile(r"""setattr\([^()]*?["'.]_[A-Z][A-Z_]*["']""")
    assert pattern.search('monkeypatch.setattr(solver, "_SHARE", 1)')
    assert pattern.search('monkeypatch.setattr("robots.batch._GROUP", 1)')
    files = [p for p in (ROOT / "tests").rglob("*.py") if p.name != "test_layout.py"]
    assert [p.name for p in files if pattern.search(p.read_text(encoding="utf-8"))] == []


def test_repetition_counts_code_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten equal lines in two files are told; imports, docstrings and comments are not equal lines."""
    sizes = module_of(ROOT / ".ci/sizes.py")
    monkeypatch.setattr(sizes, "ROOT", tmp_path)
    (tmp_path / "twin").mkdir()
    body = "".join(f"x{k} = {k}\n" for k in range(10))
    header = '"""Told."""\n' + "import os\n" * 12
    (tmp_path / "twin/a.py").write_text(header + body)
    (tmp_path / "twin/b.py").write_text(header + "# told\n" + body.replace("x5", "y5"))
    assert sizes.repeated() == []
    (tmp_path / "twin/b.py").write_text("# told\n" + body.replace("x5 = 5", "x5 = 5  # a comment\n"))
    (told,) = sizes.repeated()
    assert "twin/a.py:14 and twin/b.py:2" in told
    (tmp_path / "twin/a.py").write_text("def long():\n" + "    x = 1\n" * 60)
    assert ("twin/a.py:long", 61, "lines", 60) in list(sizes.sizes())
