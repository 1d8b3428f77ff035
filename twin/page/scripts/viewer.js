// Puts the scene, the clock and the sliders of the page together; `funtwin` is for consoles and tests.
"use strict";

const funtwin = {};
// ms from a drawing to the browser's next frame from which it was slow, how many make it late, and ms without a
// change that are rest
const [SLOW_MS, LATE, STILL_MS] = [40, 4, 250];

// Whether drawings come late. What counts is how soon after each the browser has its next frame, not when the
// next is asked for: who clicks now and then has no slow drawings.
class Pace {
  constructor() { this.rested(); }

  rested() { this.slow = 0; }

  took(ms) { this.slow = ms > SLOW_MS ? Math.min(this.slow + 1, LATE) : Math.max(this.slow - 1, 0); }

  get late() { return this.slow === LATE; }
}

// Whether the processor draws, for which smooth edges take half of the time
function bySoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const told = gl && gl.getExtension("WEBGL_debug_renderer_info");
  return Boolean(told) && /swiftshader|llvmpipe|software/i.test(gl.getParameter(told.UNMASKED_RENDERER_WEBGL));
}

(() => {
  const box = document.getElementById("view");
  if (!box) return;
  const tools = box.parentNode;
  const told = JSON.parse(document.getElementById("told").textContent);
  const canvas = box.querySelector("canvas");
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas, antialias: !bySoftware(), preserveDrawingBuffer: true });
  } catch {
    document.body.classList.add("still"); // the page's pictures instead
    funtwin.ready = Promise.resolve(false);
    return;
  }
  const fine = Math.min(window.devicePixelRatio, 2);
  renderer.setPixelRatio(fine);
  const camera = new THREE.PerspectiveCamera(40, 4 / 3, 0.02, 200);
  camera.up.set(0, 0, 1);
  const lamp = new THREE.DirectionalLight(0xffffff, 0.35); // at the eye, so that edges show
  let [scene, replays] = [null, null];
  let asked = false;
  const draw = () => {
    if (!scene) return;
    lamp.position.copy(camera.position);
    renderer.render(scene.root, camera);
  };
  // While something moves and drawings come late, they have half as many pixels a side; at rest all
  const pace = new Pace();
  const pixels = (ratio) => {
    if (renderer.getPixelRatio() === ratio) return false;
    renderer.setPixelRatio(ratio);
    resize();
    return true;
  };
  let resting = 0;
  const rest = () => {
    clearTimeout(resting);
    pace.rested();
    if (pixels(fine)) draw();
  };
  const changed = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame((now) => {
      asked = false;
      if (pace.late) pixels(fine / 2);
      draw();
      requestAnimationFrame((next) => pace.took(next - now));
      clearTimeout(resting);
      resting = setTimeout(rest, STILL_MS);
    });
  };
  // Settles when all that was asked for is on the screen, with all pixels: a browser shows what was drawn
  // before one of its frames when it begins the next
  const still = async () => {
    const frame = () => new Promise(requestAnimationFrame);
    await frame();
    rest();
    await frame();
    await frame();
  };
  const orbit = new Orbit(camera, canvas, changed);
  // Where it is seen from at first: the recording from told.view, a replay from where all of it is seen
  const first = () => (replays && replays.shown ? replays.view(told.view, camera.aspect) : told.view);
  const home = () => {
    const { eye, target, fov } = first();
    orbit.look(eye, target, fov);
  };
  const resize = () => {
    const [width, height] = [box.clientWidth, box.clientHeight];
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
  };

  const card = (part) => document.querySelector(`.joint[data-part="${part.name}"]`);
  const write = (part) => {
    const at = card(part);
    const value = part.state * part.scale;
    at.querySelector("input").value = value;
    at.querySelector("output").textContent = `${value.toFixed(1)} ${part.unit}`;
  };
  const slide = (part, state) => {
    clock.play(false);
    scene.set(part, state);
    write(part);
    changed();
  };
  const clock = new Clock(told, document.getElementById("clock"), (time) => {
    if (!scene) return;
    scene.at(time);
    told.parts.forEach(write);
    changed();
  });

  // Play the recording, or the replay of this number; who has not turned the view sees all of it
  const watch = async (k) => {
    const untouched = camera.position.distanceTo(new THREE.Vector3(...first().eye)) < 1e-6;
    clock.play(false);
    await replays.show(k);
    if (replays.asked !== k) return;
    document.body.classList.toggle("replayed", k !== null);
    resize();
    if (untouched) home();
    clock.follow(k === null ? clock.recording : tracks[k]);
  };
  const tracks = told.replays.map(({ times }) => (
    { end: times[times.length - 1], wanted: 0, film: false, set: (time) => { replays.at(time); told.parts.forEach(write); changed(); } }
  ));

  const begin = (gltf) => {
    scene = new TwinScene(gltf, told);
    replays = new Replays(scene, told.replays, parsed);
    scene.root.add(lamp);
    for (const part of told.parts) {
      const input = card(part).querySelector("input");
      input.addEventListener("input", () => slide(part, Number(input.value) / part.scale));
    }
    for (const input of tools.querySelectorAll("input[data-layer]")) {
      const set = () => { scene.show(input.dataset.layer, input.checked); changed(); };
      input.addEventListener("change", set);
      set();
    }
    const measure = new Measure(scene, camera, canvas, tools.querySelector(".measured"), changed);
    const ruler = tools.querySelector("button[name=measure]");
    ruler.addEventListener("click", () => {
      measure.switch(!measure.on);
      ruler.setAttribute("aria-pressed", Boolean(measure.on));
    });
    tools.querySelector("button[name=home]").addEventListener("click", home);
    const played = document.querySelector("#clock select");
    if (played) played.addEventListener("change", () => watch(played.value === "" ? null : Number(played.value)));
    new ResizeObserver(() => { resize(); changed(); }).observe(box);
    home();
    clock.go(0);
    resize();
    draw();
    for (const pictures of document.querySelectorAll(".stills")) pictures.open = false;
    Object.assign(funtwin, { scene, clock, orbit, measure, renderer, camera, draw, changed, resize, still, told, slide, replays, watch });
  };

  // What three.js makes of a .glb, in base64, of the page
  const parsed = (element) => new Promise((resolve, reject) => {
    const bytes = Uint8Array.from(atob(element.textContent.trim()), (c) => c.charCodeAt(0));
    new THREE.GLTFLoader().parse(bytes.buffer, "", resolve, reject);
  });
  funtwin.ready = parsed(document.getElementById("glb")).then((gltf) => { begin(gltf); return true; });
})();
