"use strict";
// What a part of a drawing is: its title, shown under the drawing for those who cannot hover.
function tell(event) {
  const part = event.target.closest && event.target.closest("g, polyline");
  const title = part && part.querySelector("title");
  const figure = title && part.closest("figure");
  const out = figure && figure.querySelector("output");
  if (out) out.textContent = title.textContent;
}
for (const kind of ["pointerover", "click"]) document.addEventListener(kind, tell);
// The three-dimensional drawing: lines carry their places (data-p, m), projected as in the report itself.
for (const svg of document.querySelectorAll("svg.scene")) {
  const numbers = (text) => text.trim().split(/\s+/).map(Number);
  const [w, h] = [svg.viewBox.baseVal.width, svg.viewBox.baseVal.height];
  const centre = numbers(svg.dataset.centre), size = Number(svg.dataset.size);
  let [a, e] = numbers(svg.dataset.view), zoom = 1;
  const lines = [...svg.querySelectorAll("polyline")].map((line) => ({ line, p: numbers(line.dataset.p) }));
  const figure = svg.closest("figure");
  function draw() {
    const sa = Math.sin(a), ca = Math.cos(a), se = Math.sin(e), ce = Math.cos(e), s = (zoom * h) / 2 / size;
    for (const { line, p } of lines) {
      let points = "";
      for (let k = 0; k + 2 < p.length; k += 3) {
        const x = p[k] - centre[0], y = p[k + 1] - centre[1], z = p[k + 2] - centre[2];
        const right = -sa * x + ca * y, up = -se * ca * x - se * sa * y + ce * z;
        points += (w / 2 + s * right).toFixed(1) + "," + (h / 2 - s * up).toFixed(1) + " ";
      }
      line.setAttribute("points", points);
    }
  }
  function turn(da, de) {
    a += da;
    e = Math.max(-1.57, Math.min(1.57, e + de));
    draw();
  }
  function nearer(factor) {
    zoom = Math.max(0.3, Math.min(12, zoom * factor));
    draw();
  }
  const fingers = new Map();
  svg.addEventListener("pointerdown", (event) => {
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    svg.setPointerCapture(event.pointerId);
  });
  for (const kind of ["pointerup", "pointercancel"]) svg.addEventListener(kind, (event) => fingers.delete(event.pointerId));
  svg.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (fingers.size === 1) {
      turn((before[0] - now[0]) * 0.008, (now[1] - before[1]) * 0.008);
    } else {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      nearer(apart(now) / Math.max(apart(before), 1));
    }
    fingers.set(event.pointerId, now);
  });
  const keys = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
  svg.addEventListener("keydown", (event) => {
    if (keys[event.key]) turn(...keys[event.key]);
    else if (event.key === "+" || event.key === "=") nearer(1.15);
    else if (event.key === "-") nearer(1 / 1.15);
    else return;
    event.preventDefault();
  });
  figure.querySelectorAll("[data-turn]").forEach((b) => b.addEventListener("click", () => turn(...numbers(b.dataset.turn))));
  figure.querySelectorAll("[data-zoom]").forEach((b) => b.addEventListener("click", () => nearer(Number(b.dataset.zoom))));
  const slider = figure.querySelector("[data-names]");
  const arm = lines.find(({ line }) => line.classList.contains("arm"));
  const cameras = lines.filter(({ line }) => line.classList.contains("camera"));
  function stop() {
    const k = Number(slider.value);
    if (arm) arm.p = numbers(slider.dataset.arms.split("|")[k]);
    cameras.forEach(({ line }, i) => line.classList.toggle("here", i === k));
    figure.querySelector("output").textContent = slider.dataset.names.split("|")[k];
    draw();
  }
  slider.addEventListener("input", stop);
  stop();
}

// Who has no mouse scrolls a wide table by the keys.
function reach() {
  for (const box of document.querySelectorAll(".wide")) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  }
}
addEventListener("resize", reach);
reach();
