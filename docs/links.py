"""Links of a built site: whether every one of them leads to a page, a picture or an anchor that is there."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit


class _Page(HTMLParser):
    """Anchors of a built page, and where its links and pictures lead."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.unresolved: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        of = dict(attrs)
        self.anchors |= {v for k in ("id", "name") if (v := of.get(k))}
        if tag in ("a", "img") and (target := of.get("href") or of.get("src")):
            self.links.add(target)
        if tag == "autoref" and "optional" not in of:
            self.unresolved.append(str(of.get("identifier")))


def broken(site: Path) -> list[str]:
    """Links and anchors of a built site that lead nowhere."""
    read = {
        p: _Page(p.read_text(encoding="utf-8")) for p in sorted(site.rglob("*.html")) if p.name != "404.html"
    }
    wrong = []
    for page, found in read.items():
        wrong += [f"{page.relative_to(site)}: [{name}] is unresolved" for name in found.unresolved]
        for link in found.links:
            path, anchor = urldefrag(link)
            if urlsplit(link).scheme or link.startswith("//"):
                continue
            to = (page.parent / unquote(path)).resolve() if path else page
            to = to / "index.html" if to.is_dir() else to
            if not to.is_file() or (anchor and to in read and unquote(anchor) not in read[to].anchors):
                wrong.append(f"{page.relative_to(site)}: {link} leads nowhere")
    return wrong
