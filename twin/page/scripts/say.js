// The user's word on the recording: a part is pointed at in the film, and a reconstruction hears it.
"use strict";

(() => {
  const at = document.getElementById("say");
  if (!at) return;
  const picture = document.querySelector("#film .frame");
  const [button, pointed] = [at.querySelector("[name=find]"), at.querySelector(".pointed")];
  const said = { point: null, first: null, last: null };
  const frame = () => funtwin.clock.frame().frame;

  const tell = () => {
    const told = [];
    if (said.point) told.push(`at ${said.point.join(",")} of frame ${said.point.frame}`);
    if (said.first !== null) told.push(`moves from frame ${said.first}`);
    if (said.last !== null) told.push(`to frame ${said.last}`);
    pointed.textContent = told.join(", ");
    button.disabled = !(said.point || (said.first !== null && said.last !== null));
  };

  picture.addEventListener("click", (e) => {
    const [box, of] = [picture.getBoundingClientRect(), funtwin.told.film.of];
    const [x, y] = [(e.clientX - box.left) / box.width, (e.clientY - box.top) / box.height];
    said.point = [Math.floor(x * of[0]), Math.floor(y * of[1])];
    said.point.frame = frame();
    const dot = picture.querySelector(".dotted") || picture.appendChild(document.createElement("span"));
    dot.className = "dotted";
    dot.style.left = `${100 * x}%`;
    dot.style.top = `${100 * y}%`;
    funtwin.clock.play(false);
    tell();
  });
  for (const end of ["first", "last"]) {
    at.querySelector(`[name=${end}]`).addEventListener("click", () => { said[end] = frame(); tell(); });
  }
  button.addEventListener("click", () => {
    const told = said.point ? [`--at ${said.point.join(",")}@${said.point.frame}`] : [];
    if (said.first !== null && said.last !== null) told.push(`--interval ${said.first}:${said.last}`);
    funtwin.send("say", { word: told.join(" ") + at.querySelector("[name=type]").value });
  });
})();
