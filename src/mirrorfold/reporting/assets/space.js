// Three dimensions: a cloud of points that turns, and a vertical cross-section of a chosen slice of range.

const LABEL = 56; // pixels from one label of the cross-section to the next

function makeSpace() {
  const { content } = state;
  const section = el("section", { class: "card full" });
  if (content.dimensions !== 3) { section.hidden = true; return section; }
  const turn = { azimuth: -0.9, elevation: 0.42, zoom: 1.15, folded: true };
  const cloud = el("canvas", { tabindex: "0", role: "img", id: "cloud",
    "aria-label": "Cloud of points coloured by bounces. Drag or use the arrow keys to turn it, plus and minus to zoom." });
  const cut = el("canvas", { role: "img", id: "section", "aria-label": "Vertical cross-section: points in the chosen slice of range" });
  const slice = { at: 0, thick: 0 };
  const { points } = content;
  const place = (i, k) => points["xyz"[k] + (turn.folded ? "" : "_initial")][i];

  function bounds(k) {
    let low = content.radar[k], high = low;
    for (let i = 0; i < points.count; i++) { low = Math.min(low, place(i, k)); high = Math.max(high, place(i, k)); }
    return [low, high];
  }
  // All multiples of a step within limits.
  function multiples(step, [low, high]) {
    const first = Math.ceil(low / step), count = Math.floor(high / step) - first + 1;
    return Array.from({ length: Math.max(0, count) }, (_, k) => (first + k) * step);
  }
  function surface(canvas, share) {
    const wide = canvas.clientWidth, high = Math.round(wide * share), ratio = Math.min(devicePixelRatio || 1, 3);
    canvas.style.height = `${high}px`;
    canvas.width = Math.round(wide * ratio);
    canvas.height = Math.round(high * ratio);
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    return [context, wide, high, getComputedStyle(document.body)];
  }
  const drag = (canvas, act) => canvas.addEventListener("pointerdown", (event) => {
    if (!drags(event)) return;
    canvas.setPointerCapture(event.pointerId);
    let last = [event.clientX, event.clientY];
    followPointer(event, (moved) => { act(moved.clientX - last[0], moved.clientY - last[1]); last = [moved.clientX, moved.clientY]; changed(); });
  });
  const tilt = (dx, dy) => { turn.azimuth += 0.008 * dx; turn.elevation = Math.min(1.55, Math.max(-1.55, turn.elevation + 0.008 * dy)); };
  drag(cloud, (dx, dy) => tilt(dx, touched ? 0 : dy));
  pinched(cloud, (factor, _, shift) => { turn.zoom *= factor; tilt(...shift); changed(); });
  cloud.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
    if (step) tilt(...step); else if (event.key === "+" || event.key === "=") turn.zoom *= 1.2; else if (event.key === "-") turn.zoom /= 1.2; else return;
    event.preventDefault();
    changed();
  });
  cloud.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && document.activeElement !== cloud) return;
    event.preventDefault(); turn.zoom *= Math.exp(-0.0012 * event.deltaY); changed();
  }, { passive: false });

  function paintCloud() {
    const [context, wide, high, style] = surface(cloud, 0.78);
    const limits = [0, 1, 2].map(bounds), middle = limits.map(([a, b]) => (a + b) / 2);
    const radius = 0.5 * Math.hypot(...limits.map(([a, b]) => b - a)), far = 4.2 * radius;
    const scale = (turn.zoom * 1.06 * Math.min(wide, high) * far) / (2 * radius);
    const [ca, sa, ce, se] = [Math.cos(turn.azimuth), Math.sin(turn.azimuth), Math.cos(turn.elevation), Math.sin(turn.elevation)];
    const project = (x, y, z) => {
      x -= middle[0]; y -= middle[1]; z -= middle[2];
      const right = ca * x + sa * y, ahead = -sa * x + ca * y, depth = ce * ahead - se * z, up = se * ahead + ce * z;
      const k = scale / (far + depth);
      return [wide / 2 + k * right, high / 2 - k * up, far + depth];
    };
    const path = (corners) => {
      context.beginPath();
      corners.forEach((corner, i) => { const [x, y] = project(...corner); if (i) context.lineTo(x, y); else context.moveTo(x, y); });
      context.stroke();
    };
    context.lineWidth = 1;
    context.strokeStyle = style.getPropertyValue("--line");
    const floor = limits[2][0];
    const step = roundStep(radius / 6);
    for (const x of multiples(step, limits[0])) path([[x, limits[1][0], floor], [x, limits[1][1], floor]]);
    for (const y of multiples(step, limits[1])) path([[limits[0][0], y, floor], [limits[0][1], y, floor]]);
    const order = [];
    for (let i = 0; i < points.count; i++) if (pointShown(points, i)) { const [x, y, d] = project(place(i, 0), place(i, 1), place(i, 2)); order.push([d, x, y, i]); }
    order.sort((a, b) => b[0] - a[0]);
    for (const [depth, x, y, i] of order) {
      const near = Math.min(1, Math.max(0, (far + radius - depth) / (2 * radius)));
      context.globalAlpha = (pointLit(points, i) ? 1 : 0.08) * (points.face[i] ? 0.22 + 0.2 * near : 0.55 + 0.45 * near);
      context.fillStyle = kindColour(kindOf(points, i));
      const size = (points.face[i] ? 1.3 : 2.4) * (0.7 + 0.7 * near);
      context.fillRect(x - size / 2, y - size / 2, size, size);
    }
    context.globalAlpha = 1;
    if (state.show.truth) { context.strokeStyle = truthColour(); content.truth.forEach((line) => path(line)); }
    if (state.show.mirrors)
      for (const mirror of content.mirrors) {
        if (!mirror.outlines) continue;
        context.globalAlpha = state.lit === null || state.lit === mirror.number ? 1 : 0.2;
        context.lineWidth = state.lit === mirror.number ? 3.5 : 1.8;
        context.strokeStyle = mirrorColour(mirror);
        (turn.folded ? mirror.folded_outlines : mirror.outlines).forEach((line) => path(line));
      }
    context.globalAlpha = 1;
    const [rx, ry] = project(...content.radar);
    context.fillStyle = style.getPropertyValue("--ink");
    context.beginPath(); context.moveTo(rx - 7, ry + 6); context.lineTo(rx + 7, ry + 6); context.lineTo(rx, ry - 7); context.fill();
  }

  function paintCut() {
    const [context, wide, high, style] = surface(cut, 0.78);
    const [x0, x1] = bounds(0), [z0, z1] = bounds(2), room = 40;
    const size = Math.max(x1 - x0, z1 - z0, content.grid.dx);
    const scale = Math.min((wide - 2 * room) / Math.max(x1 - x0, 0.02 * size), (high - 2 * room) / Math.max(z1 - z0, 0.02 * size));
    const to = (x, z) => [wide / 2 + (x - (x0 + x1) / 2) * scale, high / 2 - (z - (z0 + z1) / 2) * scale];
    context.strokeStyle = style.getPropertyValue("--line");
    context.fillStyle = style.getPropertyValue("--soft");
    context.font = "11px system-ui, DejaVu Sans, sans-serif";
    context.textAlign = "center";
    // No label touches its neighbour.
    const step = roundStep(LABEL / scale), digits = digitsOf(step), half = (wide / 2 - LABEL / 2) / scale;
    for (const value of multiples(step, [(x0 + x1) / 2 - half, (x0 + x1) / 2 + half])) { const [x] = to(value, 0); context.beginPath(); context.moveTo(x, 0); context.lineTo(x, high); context.stroke(); context.fillText(`x ${fixed(value, digits)} m`, x, high - 8); }
    context.textAlign = "left";
    for (const value of multiples(step, [z0, z1])) { const [, y] = to(0, value); context.beginPath(); context.moveTo(0, y); context.lineTo(wide, y); context.stroke(); context.fillText(`z ${fixed(value, digits)} m`, 6, y - 4); }
    let inside = 0;
    for (let i = 0; i < points.count; i++) {
      if (!pointShown(points, i) || Math.abs(place(i, 1) - slice.at) > slice.thick / 2) continue;
      inside++;
      const [x, y] = to(place(i, 0), place(i, 2)), strength = Math.min(1, Math.max(0.4, 1 - points.level[i] / state.floor));
      context.globalAlpha = (pointLit(points, i) ? 1 : 0.1) * strength;
      context.fillStyle = kindColour(kindOf(points, i));
      context.beginPath(); context.arc(x, y, 2.3, 0, 7); context.fill();
    }
    context.globalAlpha = 1;
    // The sliders are not printed: in words, which slice this is.
    count.textContent = `${inside} points at y from ${fixed(slice.at - slice.thick / 2, places)} to ${fixed(slice.at + slice.thick / 2, places)} m`;
  }

  const folded = el("button", { type: "button", "aria-pressed": "true", onclick: () => {
    turn.folded = !turn.folded; folded.setAttribute("aria-pressed", String(turn.folded)); limit(); changed();
  } }, "folded");
  const count = el("span", { class: "busy", id: "slice-count" });
  // Steps and thickness of the slice, from the depth of the scene.
  const depth = bounds(1)[1] - bounds(1)[0] || content.grid.dy, whole = roundStep(depth / 20), fine = roundStep(whole / 20), places = digitsOf(fine);
  const range = el("input", { type: "range", id: "slice", step: fine.toFixed(places), "aria-label": "range of the cross-section in metres" });
  const thick = el("input", { type: "range", min: (2 * fine).toFixed(places), max: (5 * whole).toFixed(places), step: (2 * fine).toFixed(places), value: whole.toFixed(places), "aria-label": "thickness of the cross-section in metres" });
  const shown = [el("output", {}), el("output", {})];
  const follow = () => { slice.at = Number(range.value); slice.thick = Number(thick.value); shown[0].textContent = metres(slice.at); shown[1].textContent = `${fixed(slice.thick, places)} m`; changed(); };
  function limit() {
    const [low, high] = bounds(1);
    range.min = (fine * Math.floor(low / fine + 1e-6)).toFixed(places);
    range.max = (fine * Math.ceil(high / fine - 1e-6)).toFixed(places);
  }
  range.addEventListener("input", follow);
  thick.addEventListener("input", follow);
  limit();
  // Where most of what was seen around the corner stands.
  const seen = [];
  for (let i = 0; i < points.count; i++) if (points.bounces[i] > 0 && !points.face[i]) seen.push(points.y[i]);
  seen.sort((a, b) => a - b);
  range.value = String(seen.length ? seen[seen.length >> 1] : (Number(range.min) + Number(range.max)) / 2);
  follow();
  painters.push(() => { paintCloud(); paintCut(); });
  section.append(el("h2", {}, "In space"), el("div", { class: "space" },
    el("div", {}, cloud, el("div", { class: "row" }, folded, el("span", { class: "hint" }, "drag to turn; colours count the bounces, pale points are walls"))),
    el("div", {}, cut, el("label", { class: "control" }, el("span", {}, "range y"), range, shown[0]),
      el("label", { class: "control" }, el("span", {}, "thickness"), thick, shown[1]), count)));
  return section;
}
