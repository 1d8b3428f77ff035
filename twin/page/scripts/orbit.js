// A camera that goes around a point with z up: drag turns, right drag or two fingers move, wheel or pinch zoom.
"use strict";

class Orbit {
  constructor(camera, element, changed) {
    this.camera = camera;
    this.target = new THREE.Vector3();
    this.changed = changed;
    this.pointers = new Map();
    element.style.touchAction = "none";
    element.addEventListener("pointerdown", (e) => {
      element.setPointerCapture(e.pointerId);
      this.pointers.set(e.pointerId, [e.clientX, e.clientY]);
    });
    element.addEventListener("pointermove", (e) => this._moved(e, element));
    for (const end of ["pointerup", "pointercancel"]) {
      element.addEventListener(end, (e) => this.pointers.delete(e.pointerId));
    }
    element.addEventListener("contextmenu", (e) => e.preventDefault());
    element.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.zoom(Math.exp(0.001 * e.deltaY * (e.deltaMode ? 30 : 1)));
    }, { passive: false });
  }

  // eye, target: [x, y, z] in m; fov: vertical, in degrees
  look(eye, target, fov) {
    this.camera.position.set(...eye);
    this.target.set(...target);
    if (fov) {
      this.camera.fov = fov;
      this.camera.updateProjectionMatrix();
    }
    this._aim();
  }

  turn(right, up) {
    const arm = this.camera.position.clone().sub(this.target);
    const at = new THREE.Spherical().setFromVector3(new THREE.Vector3(arm.x, arm.z, -arm.y));
    at.theta -= right;
    at.phi = Math.min(Math.max(at.phi - up, 0.02), Math.PI - 0.02);
    const v = new THREE.Vector3().setFromSpherical(at);
    this.camera.position.copy(this.target).add(new THREE.Vector3(v.x, -v.z, v.y));
    this._aim();
  }

  move(right, up) {
    const x = new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0);
    const y = new THREE.Vector3().setFromMatrixColumn(this.camera.matrixWorld, 1);
    const step = x.multiplyScalar(right).add(y.multiplyScalar(up));
    this.camera.position.add(step);
    this.target.add(step);
    this._aim();
  }

  zoom(factor) {
    const arm = this.camera.position.clone().sub(this.target);
    arm.setLength(Math.min(Math.max(arm.length() * factor, 0.05), 200));
    this.camera.position.copy(this.target).add(arm);
    this._aim();
  }

  _aim() {
    this.camera.lookAt(this.target);
    this.camera.updateMatrixWorld();
    this.changed();
  }

  _moved(e, element) {
    const before = this.pointers.get(e.pointerId);
    if (!before) return;
    const [dx, dy] = [e.clientX - before[0], e.clientY - before[1]];
    const metres = 2 * Math.tan(this.camera.fov * Math.PI / 360) / element.clientHeight
      * this.camera.position.distanceTo(this.target);
    const others = [...this.pointers].filter(([id]) => id !== e.pointerId).map(([, at]) => at);
    if (others.length) {
      const apart = (x, y) => Math.hypot(x - others[0][0], y - others[0][1]) + 1;
      this.zoom(apart(...before) / apart(e.clientX, e.clientY));
      this.move(-dx * metres / 2, dy * metres / 2);
    } else if (e.buttons & 2 || e.shiftKey) {
      this.move(-dx * metres, dy * metres);
    } else {
      this.turn(dx * Math.PI / element.clientHeight, dy * Math.PI / element.clientHeight);
    }
    this.pointers.set(e.pointerId, [e.clientX, e.clientY]);
  }
}
