// The initial and the corrected image as maps with mirrors, shadows, points and the truth.

class Panel {
  constructor(which, stage) {
    this.which = which;
    this.canvas = el("canvas", { "aria-hidden": "true" });
    this.layer = svg("svg", { role: "group", "aria-label": `mirrors of the ${which} image` });
    const words = which === "initial" ? "Initial radar image, mirrors and their shadows"
      : "Corrected image, every echo folded back to where it stands";
    this.node = el("div", { class: "panel", tabindex: "0", role: "application", "aria-label":
      `${words}. Arrow keys move the cursor, plus and minus zoom, 0 shows everything.`, "data-which": which },
      this.canvas, this.layer, el("span", { class: `name ${which}` }, which === "initial" ? "initial" : "corrected"));
    stage.append(this.node);
    this.picture = document.createElement("canvas");
    this.node.addEventListener("pointermove", (event) => { if (event.pointerType !== "touch") this.move(event); });
    this.node.addEventListener("pointerleave", (event) => { if (event.pointerType !== "touch") { state.spot = null; changed(); } });
    // A tap shows what pointing shows.
    this.node.addEventListener("click", (event) => { state.lit = null; this.point(event); });
    pinched(this.node, (factor, at, [dx, dy]) => {
      state.view.x -= dx / state.view.scale;
      state.view.y += dy / state.view.scale;
      zoom(factor, this.toWorld(at));
    });
    this.node.addEventListener("pointerdown", (event) => this.grab(event));
    this.node.addEventListener("dblclick", () => { state.view = null; changed(); });
    this.node.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== this.node) return;
      event.preventDefault();
      zoom(Math.exp(-0.0016 * event.deltaY), this.toWorld(this.place(event)));
    }, { passive: false });
    this.node.addEventListener("keydown", (event) => this.key(event));
  }

  place(event) {
    const box = this.node.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }
  toScreen([x, y]) { const { view } = state; return [this.width / 2 + (x - view.x) * view.scale, this.height / 2 - (y - view.y) * view.scale]; }
  toWorld([x, y]) { const { view } = state; return [view.x + (x - this.width / 2) / view.scale, view.y - (y - this.height / 2) / view.scale]; }

  move(event) {
    if (this.grabbed) {
      const [x, y] = this.place(event);
      state.view.x = this.grabbed.x - (x - this.grabbed.from[0]) / state.view.scale;
      state.view.y = this.grabbed.y + (y - this.grabbed.from[1]) / state.view.scale;
    }
    this.point(event);
  }
  point(event) {
    state.spot = look(this.which, this.toWorld(this.place(event)));
    changed();
  }
  grab(event) {
    this.node.focus({ preventScroll: true });
    if (!drags(event) || event.target.closest(".mirror, .handle")) return;
    if (state.draw) return state.draw(this, event);
    if (event.pointerType === "touch") return;
    this.grabbed = { x: state.view.x, y: state.view.y, from: this.place(event) };
    this.node.setPointerCapture(event.pointerId);
    followPointer(event, () => {}, () => { this.grabbed = null; });
  }
  key(event) {
    if (event.target !== this.node) return;
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.key === "+" || event.key === "=") zoom(1.3);
    else if (event.key === "-") zoom(1 / 1.3);
    else if (event.key === "0") { state.view = null; changed(); }
    else if (step) {
      const far = (event.shiftKey ? 40 : 8) / state.view.scale, from = state.spot ? state.spot.place : [state.view.x, state.view.y];
      state.spot = look(this.which, [from[0] + far * step[0], from[1] + far * step[1]]);
      changed();
    } else return;
    event.preventDefault();
  }

  // The image in colours, a pixel for a pixel; drawn anew only when the image, the floor, the map or the theme has changed.
  colours() {
    const { grid, images } = state.content, image = images[this.which];
    const key = [image, state.floor, state.map, state.dark];
    if (this.key_ && key.every((value, i) => value === this.key_[i])) return;
    this.key_ = key;
    const table = new Uint32Array(256), data = new ImageData(grid.nx, grid.ny), pixels = new Uint32Array(data.data.buffer);
    for (let count = 0; count < 256; count++) {
      const level = count ? image.lowest + (count - 1) * image.step : -Infinity;
      const [r, g, b] = mapColour(state.map, Math.min(1, Math.max(0, 1 - level / state.floor)), state.dark);
      table[count] = (255 << 24) | (Math.round(b) << 16) | (Math.round(g) << 8) | Math.round(r);
    }
    for (let j = 0; j < grid.ny; j++)
      for (let i = 0; i < grid.nx; i++) pixels[(grid.ny - 1 - j) * grid.nx + i] = table[image.bytes[j * grid.nx + i]];
    this.picture.width = grid.nx;
    this.picture.height = grid.ny;
    this.picture.getContext("2d").putImageData(data, 0, 0);
  }

  paint() {
    this.width = this.node.clientWidth;
    this.height = this.node.clientHeight;
    if (!this.width || !state.content) return;
    const ratio = state.printing ? 3 : Math.min(window.devicePixelRatio || 1, 3);
    this.canvas.width = Math.round(this.width * ratio);
    this.canvas.height = Math.round(this.height * ratio);
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    const { grid, points } = state.content;
    this.colours();
    context.fillStyle = `rgb(${mapColour(state.map, 0, state.dark).map(Math.round).join(" ")})`;
    context.fillRect(0, 0, this.width, this.height);
    const [x0, y1] = this.toScreen([grid.x0 - grid.dx / 2, grid.y0 + (grid.ny - 0.5) * grid.dy]);
    context.imageSmoothingEnabled = grid.dx * state.view.scale < 6;
    context.imageSmoothingQuality = "high";
    context.drawImage(this.picture, x0, y1, grid.nx * grid.dx * state.view.scale, grid.ny * grid.dy * state.view.scale);
    if (state.show.shadows) for (const mirror of state.content.mirrors) this.paintShadow(context, mirror);
    if (state.show.points) this.paintPoints(context, points);
    this.layer.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    this.drawLayer();
  }
  paintPoints(context, points) {
    for (const wanted of state.lit === null ? [true] : [false, true])
      for (let i = 0; i < points.count; i++) {
        if (!pointShown(points, i) || (state.lit !== null && pointLit(points, i) !== wanted)) continue;
        const [x, y] = this.toScreen(placeOf(points, i, this.which));
        if (x < -5 || y < -5 || x > this.width + 5 || y > this.height + 5) continue;
        const strong = state.lit !== null && wanted;
        context.globalAlpha = wanted ? (this.which === "initial" && !strong ? 0.55 : 0.9) : 0.12;
        const kind = kindOf(points, i), size = (strong ? 3.4 : 2.1) * (points.count > 4000 ? 0.7 : 1), far = 1.4 * size;
        context.fillStyle = kindColour(kind);
        context.beginPath();
        if (kind === PASSED) for (const [dx, dy] of [[far, 0], [0, far], [-far, 0], [0, -far]]) context.lineTo(x + dx, y + dy);
        else context.arc(x, y, size, 0, 7);
        context.fill();
      }
    context.globalAlpha = 1;
  }

  polyline(points) { return points.map((p) => this.toScreen(p).map((v) => v.toFixed(1)).join(",")).join(" "); }
  drawLayer() {
    const { content } = state, parts = [], old = document.activeElement, held = old && this.layer.contains(old) ? old.dataset : null;
    // For printing the image goes into the drawing itself: browsers may scale a canvas apart from what lies over it.
    if (state.printing) parts.push(svg("image", { href: this.canvas.toDataURL(), width: this.width, height: this.height }));
    const { spot } = state;
    if (spot && spot.path && spot.world !== null) {
      const way = this.which === "initial" ? [content.radar, spot.seemed] : spot.path;
      const last = this.toScreen(way[way.length - 1]);
      parts.push(svg("polyline", { class: "sight", points: this.polyline(way) }),
        svg("circle", { cx: last[0], cy: last[1], r: 5, fill: "none", stroke: "currentColor", "stroke-width": 1.6 }));
    }
    const [rx, ry] = this.toScreen(content.radar);
    parts.push(svg("path", { class: "radar", d: `M${rx - 8},${ry + 6}L${rx + 8},${ry + 6}L${rx},${ry - 8}Z` }));
    if (state.show.mirrors) for (const mirror of content.mirrors) parts.push(this.mirror(mirror));
    // Thin, with a rim, over the thick mirrors, so that both can be seen where they agree.
    if (state.show.truth)
      for (const line of content.truth)
        for (const [name, stroke] of [["truth rim", "var(--halo)"], ["truth", truthColour()]])
          parts.push(svg("polyline", { class: name, points: this.polyline(line), stroke }));
    if (this.handles) parts.push(...this.handles());
    parts.push(...this.scaleBar(), ...this.ticks());
    this.layer.replaceChildren(...parts.filter(Boolean));
    const same = held && (held.handle ? `[data-handle="${held.handle}"]` : `.mirror[data-number="${held.number}"]`);
    if (same) this.layer.querySelector(same)?.focus({ preventScroll: true });
  }
  // All that may be seen through a mirror; in the corrected image at its true place, for the mirror that is lit.
  paintShadow(context, mirror) {
    const { radar, dimensions, grid } = state.content, lit = state.lit === mirror.number;
    if (!lit && (state.lit !== null || this.which === "corrected")) return;
    if (this.which === "corrected" && dimensions === 3) return;
    const reach = 2 * Math.hypot(grid.nx * grid.dx, grid.ny * grid.dy);
    const face = curveOf(mirror.ends, mirror.through);
    const far = face.map(([x, y]) => {
      const k = reach / Math.max(Math.hypot(x - radar[0], y - radar[1]), 1e-9);
      return [radar[0] + k * (x - radar[0]), radar[1] + k * (y - radar[1])];
    });
    let area = [...face, ...far.reverse()];
    if (this.which === "corrected") area = area.map((p) => fold(p, mirror.number));
    context.globalAlpha = (darkStage() ? 0.22 : 0.14) * (lit ? 1.8 : 0.9);
    context.fillStyle = mirrorColour(mirror);
    context.beginPath();
    for (const p of area) context.lineTo(...this.toScreen(p));
    context.fill();
    context.globalAlpha = 1;
  }
  mirror(mirror) {
    const [ends, through] = this.which === "initial" ? [mirror.ends, mirror.through] : [mirror.folded_ends, mirror.folded_through];
    const [[x1, y1], [x2, y2]] = ends.map((p) => this.toScreen(p)), [x, y] = this.toScreen(through || middleOf(ends));
    const length = Math.hypot(x2 - x1, y2 - y1) || 1, mx = x + (14 * (y2 - y1)) / length, my = y - (14 * (x2 - x1)) / length;
    const colour = mirrorColour(mirror), number = String(mirror.number), points = this.polyline(curveOf(ends, through));
    const line = (name) => svg("polyline", { class: name, points, fill: "none", stroke: name === "line" ? colour : undefined });
    return svg("g", { class: state.lit === mirror.number ? "mirror lit" : "mirror", tabindex: "0", role: "img", "data-number": number,
      "aria-label": `mirror ${mirror.name}, generation ${mirror.generation}, ${fixed(mirror.length, placeDigits() - 1)} metres`, ...lights(mirror.number) },
      line("halo"), line("line"), line("hit"),
      svg("circle", { class: "number", cx: mx, cy: my, r: 9.5, fill: colour }),
      svg("text", { class: "label", x: mx, y: my + 0.5 }, mirror.name));
  }
  scaleBar() {
    const wanted = 0.18 * this.width / state.view.scale, power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((k) => k * power).find((l) => l <= wanted) || power;
    const size = length * state.view.scale, x = this.width - 18 - size, y = this.height - 30;
    const text = length >= 1 ? `${length} m` : length >= 0.01 ? `${Math.round(100 * length)} cm` : `${Number((1000 * length).toPrecision(1))} mm`;
    return [svg("rect", { x: x - 1.5, y: y - 1.5, width: size + 3, height: 6, fill: "var(--halo)", opacity: 0.8 }),
      svg("rect", { x, y, width: size, height: 3, fill: "currentColor" }),
      svg("text", { class: "haloed", x: x + size / 2, y: y - 6, "text-anchor": "middle" }, text)];
  }
  ticks() {
    const { view } = state, parts = [], step = roundStep(Math.min(90, this.width / 7, this.height / 7) / view.scale), digits = digitsOf(step);
    const [left, bottom] = this.toWorld([0, this.height]), [right, top] = this.toWorld([this.width, 0]);
    for (let k = Math.ceil(left / step); k * step < right; k++) {
      const [x] = this.toScreen([k * step, 0]);
      if (x < 34 || x > this.width - 58) continue;
      parts.push(svg("line", { x1: x, x2: x, y1: this.height, y2: this.height - 5, stroke: "currentColor" }),
        svg("text", { class: "tick", x, y: this.height - 8, "text-anchor": "middle" }, fixed(k * step, digits)));
    }
    for (let k = Math.ceil(bottom / step); k * step < top; k++) {
      const [, y] = this.toScreen([0, k * step]);
      if (y > this.height - 26 || y < 64) continue;
      parts.push(svg("line", { x1: 0, x2: 5, y1: y, y2: y, stroke: "currentColor" }),
        svg("text", { class: "tick", x: 8, y: y + 4 }, fixed(k * step, digits)));
    }
    parts.push(svg("text", { class: "tick axis", x: this.width - 8, y: this.height - 8, "text-anchor": "end" }, "x [m]"),
      svg("text", { class: "tick axis", x: 8, y: 54 }, "y [m]"));
    return parts;
  }
}

const NARROW = 560; // pixels

function zoom(factor, about) {
  const { view } = state, at = about || [view.x, view.y];
  view.scale *= factor;
  view.x = at[0] + (view.x - at[0]) / factor;
  view.y = at[1] + (view.y - at[1]) / factor;
  changed();
}

// Where the divider shows most: with the ghosts to one side, and the objects that they are ghosts of to the other.
function divide() {
  const { points, extent } = state.content;
  let seemed = 0, folded = 0, count = 0;
  for (let i = 0; i < points.count; i++)
    if (points.bounces[i] > 0 && !points.face[i]) { seemed += points.x_initial[i]; folded += points.x[i]; count++; }
  if (!count) return;
  state.flip = seemed > folded;
  state.swipe = Math.min(0.75, Math.max(0.25, ((seemed + folded) / (2 * count) - extent[0]) / (extent[1] - extent[0])));
}

// Both images over one another with a divider, or side by side, at one scale.
function makeStage() {
  if (state.content) divide();
  const stage = el("div", { class: "stage swipe" });
  const panels = [new Panel("initial", stage), new Panel("corrected", stage)];
  const divider = el("div", { class: "divider", role: "slider", tabindex: "0", "aria-label": "divider between the initial and the corrected image",
    "aria-valuemin": "0", "aria-valuemax": "100", "aria-orientation": "horizontal" }, el("span", { class: "grip", "aria-hidden": "true" }, "\u21d4"));
  const slide = (share) => { state.swipe = Math.min(1, Math.max(0, share)); changed(); };
  divider.addEventListener("pointerdown", (event) => {
    if (!drags(event)) return;
    divider.setPointerCapture(event.pointerId);
    followPointer(event, (moved) => slide((moved.clientX - stage.getBoundingClientRect().left) / stage.clientWidth));
    event.preventDefault();
    divider.focus({ preventScroll: true });
  });
  divider.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02, PageDown: -0.1, PageUp: 0.1 }[event.key];
    if (event.key === "Home") slide(0); else if (event.key === "End") slide(1); else if (step) slide(state.swipe + step); else return;
    event.preventDefault();
  });
  stage.append(divider);
  painters.push(() => {
    if (!state.content) return;
    const [left, right, low, top] = state.content.extent, side = state.mode === "side";
    // On a phone one below the other.
    const stacked = side && stage.clientWidth < NARROW, across = stage.clientWidth / (side && !stacked ? 2 : 1);
    const wide = right - left, high = top - low;
    const height = Math.round(Math.min(Math.max((across * high) / wide, 300), state.printing ? 440 : 0.8 * window.innerHeight));
    if (!across || !height) return; // not laid out yet: a resize follows
    stage.classList.toggle("swipe", !side);
    stage.classList.toggle("side", side);
    stage.classList.toggle("stacked", stacked);
    divider.hidden = side;
    for (const panel of panels) panel.node.style.height = `${height}px`;
    if (!state.view) {
      const scale = Math.min(across / wide, height / high);
      state.view = { x: (left + right) / 2, y: (low + top) / 2, scale };
      state.fit = { across, height };
    } else if (state.fit && (state.fit.across !== across || state.fit.height !== height)) {
      state.view.scale *= Math.min(across / state.fit.across, height / state.fit.height);
      state.fit = { across, height };
    }
    const share = `${(100 * state.swipe).toFixed(2)}%`, percent = Math.round(100 * (state.flip ? 1 - state.swipe : state.swipe));
    panels[1].node.style.clipPath = side ? "none" : state.flip ? `inset(0 calc(100% - ${share}) 0 0)` : `inset(0 0 0 ${share})`;
    stage.classList.toggle("dark", darkStage());
    stage.classList.toggle("flip", !side && state.flip);
    divider.style.left = share;
    divider.setAttribute("aria-valuenow", String(Math.round(100 * state.swipe)));
    divider.setAttribute("aria-valuetext", `${percent} percent initial image`);
    for (const panel of panels) panel.paint();
  });
  return { stage, panels };
}
