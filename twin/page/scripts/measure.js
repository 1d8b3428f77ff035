// Distance of two points that are clicked on the twin, in mm.
"use strict";

class Measure {
  constructor(scene, camera, element, told, changed) {
    Object.assign(this, { scene, camera, element, told, changed, points: [], marks: [] });
    let down = [0, 0];
    element.addEventListener("pointerdown", (e) => { down = [e.clientX, e.clientY]; });
    element.addEventListener("pointerup", (e) => {
      if (this.on && Math.hypot(e.clientX - down[0], e.clientY - down[1]) < 4) this._click(e);
    });
  }

  switch(on) {
    this.on = on;
    this.element.style.cursor = on ? "crosshair" : "grab";
    this._clear();
    this.told.textContent = on ? "click two points" : "";
    this.changed();
  }

  // The point [x, y, z] of the surface at a pixel of the canvas, or null
  pick(x, y) {
    const box = this.element.getBoundingClientRect();
    const at = new THREE.Vector2(2 * x / box.width - 1, 1 - 2 * y / box.height);
    const ray = new THREE.Raycaster();
    ray.setFromCamera(at, this.camera);
    const seen = (node) => !node || (node.visible && seen(node.parent));
    const hit = ray.intersectObject(this.scene.world, true).find((h) => h.object.isMesh && seen(h.object));
    return hit ? hit.point.toArray() : null;
  }

  _click(e) {
    const box = this.element.getBoundingClientRect();
    const point = this.pick(e.clientX - box.left, e.clientY - box.top);
    if (!point) return;
    if (this.points.length === 2) this._clear();
    this.points.push(point);
    const ball = new THREE.Mesh(new THREE.SphereGeometry(0.006), new THREE.MeshBasicMaterial({ color: 0x1d2329, depthTest: false }));
    ball.position.set(...point);
    this._add(ball);
    if (this.points.length === 2) {
      this._add(this.scene._line(this.points, 0x1d2329));
      const [a, b] = this.points;
      this.told.textContent = `${(1000 * Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2])).toFixed(1)} mm`;
    }
    this.changed();
  }

  _add(mark) {
    this.marks.push(mark);
    this.scene.root.add(mark);
  }

  _clear() {
    for (const mark of this.marks) this.scene.root.remove(mark);
    this.marks = [];
    this.points = [];
  }
}
