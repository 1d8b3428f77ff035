// The twin as three.js draws it: links that stand at their joints' states, layers that are switched, paths.
"use strict";

const LAYERS = ["seen", "evidence", "assumed", "collision", "axes", "paths"];

class TwinScene {
  // gltf: as THREE.GLTFLoader gives it; told: scene_document of viewer.py
  constructor(gltf, told) {
    this.told = told;
    this.root = new THREE.Scene();
    this.root.background = new THREE.Color(0xf6f7f9);
    this.root.add(new THREE.HemisphereLight(0xffffff, 0xb8b4ac, 1.0));
    this.world = gltf.scene;
    this.world.rotation.x = Math.PI / 2; // glTF is y up, the twin z up
    this.root.add(this.world);
    this.links = new Map();
    this.layers = new Map(LAYERS.map((name) => [name, []]));
    this.world.traverse((node) => this._sort(node));
    for (const part of told.parts) this._mark(part);
    this._path();
    this.world.updateMatrixWorld(true);
    this.show("collision", false);
  }

  _sort(node) {
    const data = node.userData;
    if (data.link) this.links.set(data.link, node);
    if (data.joint) node.userData.home = node.position.clone();
    if (data.basis) this.layers.get(data.role === "collision" ? "collision" : data.basis).push(node);
    if (node.isMesh) node.material = this._paint(node);
  }

  // Photographs have their light in them; other surfaces get ours. All is drawn in sRGB as it comes: a processor
  // that draws takes a third longer if each pixel is made linear and back.
  _paint(mesh) {
    const told = mesh.userData.role ? mesh.userData : mesh.parent.userData;
    const old = mesh.material;
    const more = { side: old.side, map: old.map, color: old.color.convertLinearToSRGB(), vertexColors: old.vertexColors };
    if (old.map) {
      old.map.encoding = THREE.LinearEncoding;
      old.map.minFilter = THREE.LinearMipmapNearestFilter;
    }
    if (old.vertexColors) asSRGB(mesh.geometry);
    if (told.role === "collision") {
      return new THREE.MeshLambertMaterial({ color: 0x2f6fde, transparent: true, opacity: 0.35, depthWrite: false });
    }
    return old.map ? new THREE.MeshBasicMaterial(more) : new THREE.MeshLambertMaterial(more);
  }

  // The axis of a part stands where its parent is, the place of the hand moves with the part
  _mark(part) {
    const link = this.links.get(part.name);
    if (!link) return;
    const [a, b] = part.axis.map((p) => new THREE.Vector3(...p));
    const along = b.clone().sub(a);
    const arrow = new THREE.ArrowHelper(along.clone().normalize(), a.add(link.userData.home), along.length(), 0xe21e5a, 0.05, 0.025);
    link.parent.add(arrow);
    this.layers.get("axes").push(arrow);
    if (!part.contact) return;
    const ball = new THREE.Mesh(new THREE.SphereGeometry(0.012), new THREE.MeshBasicMaterial({ color: 0xffdd33 }));
    ball.position.set(...part.contact);
    link.add(ball);
    this.layers.get("axes").push(ball);
    part.ball = ball;
  }

  _path() {
    const { positions } = this.told.cameras;
    if (!positions) return;
    const line = this._line(positions, 0x7828c8);
    const [x, y, z] = [0.06, 0.045, 0.1];
    const corners = [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]];
    const edges = corners.flatMap((c, k) => [[0, 0, 0], c, c, corners[(k + 1) % 4]]);
    this.camera = new THREE.LineSegments(this._geometry(edges), new THREE.LineBasicMaterial({ color: 0x14a0dc }));
    this.root.add(line, this.camera);
    this.layers.get("paths").push(line, this.camera);
    for (const part of this.told.parts) {
      if (!part.ball || part.held.length < 2) continue;
      const hand = this._line(part.held.map((t) => this._held(part, t)), 0xf08c2e);
      this.root.add(hand);
      this.layers.get("paths").push(hand);
    }
  }

  _held(part, time) {
    this.at(time);
    this.world.updateMatrixWorld(true);
    return part.ball.getWorldPosition(new THREE.Vector3()).toArray();
  }

  _line(points, color) {
    return new THREE.Line(this._geometry(points), new THREE.LineBasicMaterial({ color }));
  }

  _geometry(points) {
    return new THREE.BufferGeometry().setFromPoints(points.map((p) => new THREE.Vector3(...p)));
  }

  show(layer, visible) {
    for (const node of this.layers.get(layer)) node.visible = visible;
  }

  // state: m or rad
  set(part, state) {
    const link = this.links.get(part.name);
    if (!link) return;
    const { type, axis } = link.userData.joint;
    const direction = new THREE.Vector3(...axis);
    part.state = state;
    if (type === "revolute") link.quaternion.setFromAxisAngle(direction, state);
    else link.position.copy(link.userData.home).addScaledVector(direction, state);
  }

  // Parts and camera as they were at a time of the recording, s
  at(time) {
    for (const part of this.told.parts) {
      if (part.times.length) this.set(part, between(part.times, part.states, time));
    }
    const { times, positions, quaternions } = this.told.cameras;
    if (!times) return;
    const k = last(times, time);
    this.camera.position.set(...positions[k]);
    this.camera.quaternion.set(...quaternions[k]);
  }
}

// Vertex colours, which glTF has linear, as sRGB
function asSRGB(geometry) {
  const linear = geometry.getAttribute("color");
  const out = new Float32Array(3 * linear.count);
  const color = new THREE.Color();
  for (let k = 0; k < linear.count; k++) {
    color.setRGB(linear.getX(k) / 65535, linear.getY(k) / 65535, linear.getZ(k) / 65535).convertLinearToSRGB().toArray(out, 3 * k);
  }
  geometry.setAttribute("color", new THREE.BufferAttribute(out, 3));
}

// Index of the last of rising times that is not after `time`, the first where all are
function last(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time + 1e-9) low = middle + 1;
    else high = middle;
  }
  return Math.max(0, low - 1);
}

// The value at a time, straight between two that are known, held before the first and after the last
function between(times, values, time) {
  const k = last(times, time);
  if (k + 1 >= times.length || time <= times[k]) return values[k];
  const share = (time - times[k]) / (times[k + 1] - times[k]);
  return values[k] + share * (values[k + 1] - values[k]);
}
