// Robots' replays in the scene: one at a time, its links where the simulation had them, parts as they moved.
"use strict";

const BASE = "stand/pedestal"; // the link that the robot stands on
const DIM = 0.82; // of a robot's colours: most are white, and the scene's light would leave them no shades

class Replays {
  // told: of each replay what replays.py tells; load: gives what three.js makes of a .glb of the page
  constructor(scene, told, load) {
    Object.assign(this, { scene, told, load, shown: null });
    this.robots = new Map(); // by replay, once it was asked for
  }

  // Show the replay of this number, none without; settles when it is there
  async show(k) {
    this.asked = k;
    if (k !== null && !this.robots.has(k)) this.robots.set(k, this._robot(this.told[k]));
    const robot = k === null ? null : await this.robots.get(k);
    if (this.asked !== k) return; // another was asked for meanwhile
    if (this.shown) this.scene.root.remove(this.shown.node);
    if (robot) this.scene.root.add(robot.node);
    this.shown = robot;
  }

  // Links and parts at a time of the replay that is shown, s
  at(time) {
    const { told, links } = this.shown;
    for (const part of this.scene.told.parts) this.scene.set(part, between(told.times, told.states[part.name], time));
    const k = last(told.times, time);
    const next = Math.min(k + 1, told.times.length - 1);
    const span = told.times[next] - told.times[k];
    const share = span ? Math.min(Math.max((time - told.times[k]) / span, 0), 1) : 0;
    for (const [link, { positions, quaternions }] of links) {
      link.position.set(...positions[k]).lerp(new THREE.Vector3(...positions[next]), share);
      // of rounded quaternions longer than 1 three.js takes the first alone
      link.quaternion.set(...quaternions[k]).normalize().slerp(new THREE.Quaternion(...quaternions[next]).normalize(), share);
    }
  }

  // Where the replay is seen from at first: from beside the way between the robot and the parts, on the side of
  // the recording's view, with all that the robot reaches in the picture
  view({ eye, target, fov }, aspect) {
    const { told } = this.shown;
    const ways = Object.values(told.links).map((l) => l.positions);
    const box = new THREE.Box3().setFromPoints(ways.flat().map((p) => new THREE.Vector3(...p)));
    const middle = new THREE.Vector3(...target);
    box.expandByPoint(middle).expandByScalar(0.12); // half as thick as an arm
    const ball = box.getBoundingSphere(new THREE.Sphere());
    const away = new THREE.Vector3(...told.links[BASE].positions[0]).sub(middle).setZ(0).normalize();
    const side = new THREE.Vector3(-away.y, away.x, 0);
    if (side.dot(new THREE.Vector3(...eye).sub(middle)) < 0) side.negate();
    const way = side.addScaledVector(away, 0.4).add(new THREE.Vector3(0, 0, 0.4)).normalize();
    const half = Math.atan(Math.tan(fov * Math.PI / 360) * Math.min(1, aspect));
    const from = ball.center.clone().addScaledVector(way, ball.radius / Math.sin(half));
    return { eye: from.toArray(), target: ball.center.toArray(), fov };
  }

  async _robot(told) {
    const gltf = await this.load(document.querySelectorAll("script.robot")[told.robot]);
    const node = new THREE.Group();
    const links = new Map(Object.entries(told.links).map(([name, poses]) => {
      const link = new THREE.Group();
      link.userData.link = name;
      node.add(link);
      return [link, poses];
    }));
    const named = new Map([...links.keys()].map((link) => [link.userData.link, link]));
    for (const meshes of gltf.scene.children) {
      named.get(meshes.userData.link).add(meshes.clone());
    }
    node.traverse((n) => {
      if (n.isMesh) n.material = new THREE.MeshLambertMaterial({ color: n.material.color.clone().convertLinearToSRGB().multiplyScalar(DIM) });
    });
    if (told.column) named.get(BASE).add(this._column(told.column));
    return { node, links, told };
  }

  _column([radius, length, ...middle]) {
    const column = new THREE.Mesh(
      new THREE.CylinderGeometry(radius, radius, length, 32), new THREE.MeshLambertMaterial({ color: 0x73787f }),
    );
    column.rotation.x = Math.PI / 2; // three.js has it along y
    column.position.set(...middle);
    return column;
  }
}
