// Edits of the twin: each goes to the server that gave this page, which gives the page anew.
"use strict";

(() => {
  const answer = document.getElementById("answer");
  const kept = "funtwin-view";
  const ASK_MS = 500; // between two questions how far a reconstruction is

  // The page anew, shown as it is now; told: what to say then
  const reload = (told = "") => {
    const view = { told, scroll: scrollY };
    if (funtwin.scene) { // else pictures stand in for it
      const { camera, orbit, clock } = funtwin;
      const open = [...document.querySelectorAll(".editor[open]")].map((e) => e.closest(".joint").dataset.part);
      Object.assign(view, { eye: camera.position.toArray(), target: orbit.target.toArray(), time: clock.recording.wanted, open });
    }
    sessionStorage.setItem(kept, JSON.stringify(view));
    location.reload();
  };

  const ask = async (address, request) => {
    try {
      return await (await fetch(address, request)).json();
    } catch (error) {
      return { ok: false, error: `the server does not answer (${error.message}): run twin view again` };
    }
  };

  const follow = async () => {
    document.body.classList.add("working");
    let told;
    do {
      await new Promise((resolve) => { setTimeout(resolve, ASK_MS); });
      told = await ask("work");
      answer.textContent = told.error || told.line || "it begins";
    } while (told.running);
    document.body.classList.remove("working");
    if (!told.error) reload(told.warnings.join("; "));
  };

  const send = async (address, body) => {
    answer.textContent = "";
    const told = await ask(address, {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body),
    });
    if (told.ok && !told.working) {
      reload();
      return;
    }
    answer.textContent = told.ok ? "it begins" : told.error;
    answer.scrollIntoView({ block: "center" });
    if (told.ok) await follow();
  };
  funtwin.send = send;

  // A point of the scene as it stands, in the world with all parts at state 0
  const atRest = (part, point) => {
    let link = funtwin.scene.links.get(part.name);
    const at = link.worldToLocal(new THREE.Vector3(...point));
    for (; link && link.userData.link; link = link.parent) at.add(link.userData.home || new THREE.Vector3());
    return at.toArray();
  };

  // The axis turned by some degrees about the direction of view: clockwise is positive
  const nudged = (part, degrees) => {
    const link = funtwin.scene.links.get(part.name);
    const about = funtwin.camera.getWorldDirection(new THREE.Vector3());
    const axis = new THREE.Vector3(...link.userData.joint.axis);
    return axis.applyAxisAngle(about, degrees * Math.PI / 180).toArray().map((v) => v.toFixed(9)).join(",");
  };

  const picked = () => new Promise((resolve) => {
    answer.textContent = "click the piece in the scene";
    const canvas = document.querySelector("#view canvas");
    canvas.addEventListener("pointerup", (e) => {
      const box = canvas.getBoundingClientRect();
      resolve(funtwin.measure.pick(e.clientX - box.left, e.clientY - box.top));
    }, { once: true });
  });

  const valueOf = async (button, card, part) => {
    const { what, value, suffix = "", nudge } = button.dataset;
    if (value !== undefined) return `=${value}`;
    if (nudge !== undefined) return `=${nudged(part, Number(nudge))}`;
    if ("alone" in button.dataset) return "";
    if ("state" in button.dataset) return `=${part.state * part.scale}${suffix}`;
    if ("pick" in button.dataset) {
      const point = await picked();
      return point && `=${atRest(part, point).map((v) => v.toFixed(6)).join(",")}`;
    }
    return `=${card.querySelector(`[name=${what}]`).value}${suffix}`;
  };

  document.addEventListener("click", async (e) => {
    const button = e.target.closest("button[data-what], button[data-say]");
    if (!button) return;
    const card = button.closest(".joint");
    const part = funtwin.told.parts.find((p) => p.name === card.dataset.part);
    if (button.dataset.say) {
      await send("say", { part: part.name, word: button.dataset.say });
      return;
    }
    const value = await valueOf(button, card, part);
    if (value === null) return;
    await send("edit", {
      part: part.name, edit: `${button.dataset.what}${value}`, why: card.querySelector("[name=why]").value,
    });
  });
  const undo = document.getElementById("undo");
  if (undo) undo.addEventListener("click", () => send("undo", {}));

  funtwin.ready.then((drawn) => {
    const view = JSON.parse(sessionStorage.getItem(kept) || "null");
    sessionStorage.removeItem(kept);
    if (!view) return;
    answer.textContent = view.told;
    if (!drawn || !view.eye) return;
    funtwin.orbit.look(view.eye, view.target);
    funtwin.clock.go(view.time);
    for (const name of view.open) {
      const editor = document.querySelector(`.joint[data-part="${name}"] .editor`);
      if (editor) editor.open = true;
    }
    scrollTo(0, view.scroll);
  });
})();
