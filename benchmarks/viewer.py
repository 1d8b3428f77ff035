"""Frames a second of a page's scene, and how large the page is, in Chromium that draws by the processor.

    python -m benchmarks.viewer RUN...

The scene is drawn at 640x480 px from its first view, parts in motion, one drawing after the other, whose time
ends when its pixels are read. As the recording plays, the page draws fewer pixels where it would be late.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from benchmarks.browser import browser, missing
from twin.page import render

_SIZE, _DRAWINGS = (640, 480), 40
_DRAW = """(() => {
  const { renderer, camera, scene, told, draw } = funtwin;
  renderer.setPixelRatio(1); renderer.setSize(%d, %d, false);
  camera.aspect = %d / %d; camera.updateProjectionMatrix();
  const gl = renderer.getContext(), pixel = new Uint8Array(4), times = [];
  for (let k = 0; k < %d; k++) {
    const start = performance.now();
    for (const p of told.parts) scene.set(p, p.lower + (p.upper - p.lower) * k / %d);
    draw(); gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    times.push(performance.now() - start);
  }
  times.sort((a, b) => a - b);
  return [times[times.length >> 1], renderer.info.render.triangles];
})()"""


# while the recording plays, in a scene of this size on the page
_PLAY = """(async () => {
  const box = document.getElementById("view");
  Object.assign(box.style, { width: "%dpx", height: "%dpx", aspectRatio: "auto", maxHeight: "none" });
  const { clock, renderer } = funtwin;
  await new Promise((done) => setTimeout(done, 600));
  clock.go(0); clock.play(true);
  await new Promise((done) => setTimeout(done, 1500));
  const [first, start] = [renderer.info.render.frame, performance.now()];
  await new Promise((done) => setTimeout(done, 3000));
  clock.play(false);
  return 1000 * (renderer.info.render.frame - first) / (performance.now() - start);
})()"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("runs", metavar="RUN", type=Path, nargs="+")
    runs = parser.parse_args().runs
    if reason := missing():
        raise SystemExit(reason)
    print("| run | triangles | whole pictures a second | frames a second as it plays | page, MB | ready, s |")
    print("|---|---|---|---|---|---|")
    for run in runs:
        page = render(run)
        with (
            tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile,
            browser(Path(profile)) as tab,
        ):
            tab.open(page.resolve().as_uri())
            ready = tab.run("funtwin.ready.then(() => performance.now() / 1000)")
            width, height = _SIZE
            playing = tab.run(_PLAY % _SIZE)
            median, triangles = tab.run(_DRAW % (width, height, width, height, _DRAWINGS, _DRAWINGS))
        size = page.stat().st_size / 1e6
        print(
            f"| {run.name} | {triangles:,} | {1000 / median:.0f} | {playing:.0f} | {size:.1f} | {ready:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
