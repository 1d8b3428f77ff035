// Marks on a recording's pictures, and what follows from them drawn over these; `annotation` is for consoles and tests.
"use strict";

const annotation = { frame: 0, tool: "", places: [], marks: [], solved: {}, begun: null };

(() => {
  const $ = (id) => document.getElementById(id);
  const [image, canvas] = [document.querySelector("#picture img"), document.querySelector("#picture svg")];
  const NEEDED = { axis: 2, point: 1 }; // places that end a mark
  const DOT_PX = 4; // of a corner, on the screen
  let told = null; // size, frames and times of the recording
  let playing = 0;

  const say = (text, bad = false) => {
    $("answer").textContent = text;
    $("answer").className = bad ? "bad" : "";
  };

  const send = async (what, body = {}) => {
    let answer;
    try {
      const request = { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
      answer = await (await fetch(what, request)).json();
    } catch (error) {
      answer = { ok: false, error: `the server does not answer (${error.message}): run twin annotate again` };
    }
    say(answer.ok ? "" : answer.error, !answer.ok);
    return answer.ok ? answer : null;
  };

  const part = () => $("part").value;
  const ofPart = (what) => annotation.marks.filter((m) => m.part === part() && m.what === what);

  const mark = async (what, value, name = part()) => {
    const answer = await send("mark", { part: name, what, value });
    if (answer) keep(answer.marks);
    return Boolean(answer);
  };

  // What was solved of a part holds until it is marked again
  const keep = (marks) => {
    for (const name of Object.keys(annotation.solved)) {
      const of = (all) => JSON.stringify(all.filter((m) => m.part === name));
      if (of(marks) !== of(annotation.marks)) delete annotation.solved[name];
    }
    annotation.marks = marks;
    const before = part();
    const names = [...new Set(marks.filter((m) => m.what === "part").map((m) => m.part))];
    $("part").replaceChildren(...names.map((n) => new Option(n, n)));
    $("part").value = names.includes(before) ? before : names.at(-1) || "";
    $("marks").replaceChildren(...marks.map((m) => {
      const item = document.createElement("li");
      item.textContent = `${m.part} ${m.what} ${m.value}`;
      return item;
    }));
    const last = (what) => (marks.filter((m) => m.what === what).at(-1) || { value: "" }).value;
    $("description").value = last("description");
    $("only").checked = last("only") === "yes";
    for (const button of document.querySelectorAll("[data-tool], #first, #last, #closed, #solve")) button.disabled = !names.length;
    $("undo").disabled = !marks.length;
    draw();
  };

  const shape = (kind, values, style) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", kind);
    for (const [name, value] of Object.entries({ ...values, ...style })) node.setAttribute(name, value);
    return node;
  };
  const line = (places, style, closed) =>
    shape(closed ? "polygon" : "polyline", { points: places.map((p) => p.join(",")).join(" "), fill: "none", "vector-effect": "non-scaling-stroke" }, style);
  const dot = (place, color) => {
    const scale = told.size[0] / image.clientWidth;
    return shape("circle", { cx: place[0], cy: place[1], r: DOT_PX * scale, fill: color, stroke: "#fff", "vector-effect": "non-scaling-stroke" });
  };
  const read = (value) => {
    const [frame, ...places] = value.split(" ");
    return { frame: parseInt(frame, 10), places: places.map((p) => p.split(",").map(Number)) };
  };

  const draw = () => {
    if (!told) return;
    const [mine, found] = [{ stroke: "#e21e5a", "stroke-width": 2 }, { stroke: "#14a0dc", "stroke-width": 3 }];
    const out = [];
    const solved = annotation.solved[part()];
    if (solved) {
      const [outline, axis] = [solved.outline[annotation.frame], solved.axis[annotation.frame]];
      if (outline) out.push(line(outline, found, true));
      if (axis) out.push(line(axis, { ...found, stroke: "#f08c2e" }, false));
    }
    for (const what of ["outline", "axis", "point"]) {
      for (const { frame, places } of ofPart(what).map((m) => read(m.value))) {
        if (frame !== annotation.frame) continue;
        if (what !== "point") out.push(line(places, mine, what === "outline"));
        else out.push(dot(places[0], "#e21e5a"));
      }
    }
    if (annotation.places.length) {
      out.push(line(annotation.places, { ...mine, "stroke-dasharray": "5 4" }, false), ...annotation.places.map((p) => dot(p, "#e21e5a")));
    }
    canvas.replaceChildren(...out);
    chart(solved);
  };

  const chart = (solved) => {
    const box = $("states");
    box.setAttribute("viewBox", `0 0 ${told.frames} 100`);
    const out = ofPart("moves").map((m) => {
      const [a, b] = m.value.split(":").map(Number);
      return shape("rect", { x: a, y: 0, width: b - a, height: 100, fill: "#e21e5a", opacity: 0.15 });
    });
    if (solved) {
      const [low, high] = [Math.min(...solved.states), Math.max(...solved.states)];
      const y = (s) => 92 - 84 * (s - low) / (high - low || 1);
      out.push(line(solved.states.map((s, k) => [k + 0.5, y(s)]), { stroke: "#14a0dc", "stroke-width": 2 }, false));
      $("told").textContent = `${solved.states[annotation.frame].toFixed(1)} ${solved.unit} here; ${[solved.told, ...solved.notes].join("; ")}`;
    }
    out.push(line([[annotation.frame + 0.5, 0], [annotation.frame + 0.5, 100]], { stroke: "#1d2329", "stroke-width": 1 }, false));
    box.replaceChildren(...out);
  };

  annotation.go = (frame) => {
    annotation.frame = Math.min(Math.max(frame, 0), told.frames - 1);
    $("time").value = annotation.frame;
    $("frame").textContent = `frame ${annotation.frame}, ${told.times[annotation.frame].toFixed(2)} s`;
    const loaded = new Promise((resolve) => { image.onload = () => resolve(true); image.onerror = () => resolve(false); });
    image.src = `frame/${annotation.frame}`;
    draw();
    return loaded;
  };

  const use = (tool) => {
    annotation.tool = annotation.tool === tool ? "" : tool;
    annotation.places = [];
    for (const b of document.querySelectorAll("[data-tool]")) b.setAttribute("aria-pressed", b.dataset.tool === annotation.tool);
    draw();
  };

  const whole = () => annotation.tool === "outline" && annotation.places.length > 2;

  const finish = async () => {
    const value = `${annotation.frame}: ${annotation.places.map((p) => p.map((v) => v.toFixed(1)).join(",")).join(" ")}`;
    const { tool } = annotation;
    use(tool);
    await mark(tool, value);
  };

  $("picture").addEventListener("click", async (e) => {
    if (!annotation.tool) return;
    const box = image.getBoundingClientRect();
    const at = [(e.clientX - box.left) / box.width, (e.clientY - box.top) / box.height];
    annotation.places.push(at.map((v, k) => v * told.size[k] - 0.5)); // pixel centres are whole numbers
    if (annotation.places.length === NEEDED[annotation.tool]) await finish();
    draw();
  });

  const play = (on) => {
    clearTimeout(playing);
    $("play").textContent = on ? "❚❚" : "▶";
    playing = 0;
    if (!on) return;
    const next = async () => {
      await annotation.go(annotation.frame + 1 < told.frames ? annotation.frame + 1 : 0);
      if (playing) playing = setTimeout(next, 40);
    };
    playing = setTimeout(next, 0);
  };

  document.addEventListener("keydown", (e) => {
    if (e.target.matches("input:not([type=range]), select")) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
    if (step) {
      e.preventDefault();
      play(false);
      annotation.go(annotation.frame + step * (e.shiftKey ? 10 : 1));
    } else if (e.key === "Enter" && whole()) finish();
    else if (e.key === "Escape") use(annotation.tool);
  });
  for (const b of document.querySelectorAll("[data-tool]")) b.addEventListener("click", () => (whole() && b.dataset.tool === "outline" ? finish() : use(b.dataset.tool)));
  for (const b of document.querySelectorAll("[data-step]")) b.addEventListener("click", () => { play(false); annotation.go(annotation.frame + Number(b.dataset.step)); });
  for (const b of document.querySelectorAll("[data-add]")) {
    b.addEventListener("click", async () => {
      const name = $("new").value.trim();
      if (await mark("part", b.dataset.add, name)) {
        $("part").value = name;
        $("new").value = "";
        draw();
      }
    });
  }
  $("time").addEventListener("input", () => { play(false); annotation.go(Number($("time").value)); });
  $("play").addEventListener("click", () => play(!playing));
  $("part").addEventListener("change", draw);
  $("first").addEventListener("click", () => { annotation.begun = annotation.frame; say(`it begins in frame ${annotation.begun}: now the frame in which it rests again`); });
  $("last").addEventListener("click", async () => {
    if (annotation.begun === null) say("first the frame in which it begins to move", true);
    else if (await mark("moves", `${annotation.begun}:${annotation.frame}`)) annotation.begun = null;
  });
  $("closed").addEventListener("click", () => mark("closed", `${annotation.frame}`));
  $("undo").addEventListener("click", async () => {
    const answer = await send("undo");
    if (answer) keep(answer.marks);
  });
  $("solve").addEventListener("click", async () => {
    say("solving");
    const name = part();
    const answer = await send("solve", { part: name });
    if (answer) annotation.solved[name] = answer;
    draw();
  });
  $("only").addEventListener("change", () => mark("only", $("only").checked ? "yes" : "no", ""));
  $("description").addEventListener("change", () => mark("description", $("description").value, ""));
  $("write").addEventListener("click", async () => {
    say("writing");
    const answer = await send("write");
    if (answer) say([`written: ${answer.truth}`, ...answer.notes].join("; "));
  });

  annotation.ready = fetch("marks").then((answer) => answer.json()).then(async (answer) => {
    told = answer;
    annotation.told = told;
    $("name").textContent = told.name;
    $("time").max = told.frames - 1;
    canvas.setAttribute("viewBox", `-0.5 -0.5 ${told.size[0]} ${told.size[1]}`);
    canvas.setAttribute("preserveAspectRatio", "none");
    keep(told.marks);
    return annotation.go(0);
  });
})();
