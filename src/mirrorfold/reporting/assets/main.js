// Puts the parts of the page together, and starts it.

function makeScale() {
  const strip = el("canvas", { width: 256, height: 1, "aria-hidden": "true" });
  const low = el("span", {}), high = el("span", {}, "0 dB");
  const floor = el("input", { type: "range", id: "floor", min: "-60", max: "-6", step: "1", value: String(state.floor) });
  const shown = el("output", { for: "floor" });
  floor.addEventListener("input", () => { state.floor = Number(floor.value); changed(); });
  const map = el("select", { id: "map", "aria-label": "colour map", onchange: () => { state.map = map.value; changed(); } },
    Object.keys(MAPS).map((name) => el("option", { value: name }, name)));
  painters.push(() => {
    const context = strip.getContext("2d"), data = context.createImageData(256, 1);
    for (let i = 0; i < 256; i++) data.data.set([...mapColour(state.map, i / 255, state.dark), 255], 4 * i);
    context.putImageData(data, 0, 0);
    low.textContent = `${fixed(state.floor, 0)} dB`;
    shown.textContent = `${fixed(state.floor, 0)} dB`;
  });
  return [el("div", { class: "scale" }, low, strip, high), el("label", { class: "control" }, el("span", {}, "floor"), floor, shown),
    el("label", { class: "control" }, el("span", {}, "colours"), map, el("span", {}))];
}

function makeLegend() {
  const legend = el("div", { class: "legend" });
  painters.push(() => {
    const { content } = state;
    if (!content || (legend.drawn === content && legend.truth === truthColour())) return;
    Object.assign(legend, { drawn: content, truth: truthColour() });
    const counts = new Set(content.mirrors.map((mirror) => mirror.generation - 1));
    for (let i = 0; i < content.points.count; i++) counts.add(kindOf(content.points, i));
    legend.replaceChildren(...[...counts].sort().map((kind) => el("label", {},
      el("input", { type: "checkbox", checked: !state.hidden.has(kind), "data-bounces": String(kind), onchange: (event) => {
        if (event.target.checked) state.hidden.delete(kind); else state.hidden.add(kind);
        changed();
      } }), el("span", { class: kind === PASSED ? "swatch diamond" : "swatch", style: { background: kindColour(kind) } }), kindText(kind))),
      content.truth.length ? el("label", {}, el("span", { class: "swatch truth", style: { background: truthColour() } }), "truth") : "");
  });
  return legend;
}

function makeControls() {
  const confidence = el("input", { type: "range", id: "confidence", min: "0", max: "1", step: "0.01", value: String(state.confidence) });
  const shown = el("output", { for: "confidence" });
  confidence.addEventListener("input", () => { state.confidence = Number(confidence.value); changed(); });
  painters.push(() => { confidence.value = String(state.confidence); shown.textContent = fixed(state.confidence, 2); });
  return [...makeScale(), el("label", { class: "control" }, el("span", {}, "confidence \u2265"), confidence, shown)];
}

function makeBar() {
  const modes = { swipe: "swipe", side: "side by side" };
  const buttons = Object.entries(modes).map(([mode, text]) => el("button", { type: "button", "data-mode": mode, onclick: () => {
    state.mode = mode; state.view = null; changed();
  } }, text));
  painters.push(() => buttons.forEach((button) => button.setAttribute("aria-pressed", String(button.dataset.mode === state.mode))));
  const toggles = Object.keys(state.show).filter((name) => name !== "truth" || !state.content || state.content.truth.length).map((name) =>
    el("label", {}, el("input", { type: "checkbox", checked: true, "data-show": name, onchange: (event) => { state.show[name] = event.target.checked; changed(); } }), name));
  const glass = [["\u2212", "zoom out", () => zoom(1 / 1.4)], ["+", "zoom in", () => zoom(1.4)], ["fit", "show everything", () => { state.view = null; changed(); }]];
  return el("div", { class: "bar" }, el("div", { class: "group", role: "group", "aria-label": "how to compare" }, buttons), toggles,
    el("span", { class: "spring" }), el("div", { class: "group" }, glass.map(([text, name, act]) => el("button", { type: "button", "aria-label": name, title: name, onclick: act }, text))));
}

function makeHeader() {
  const facts = el("p", { class: "lead facts" }), title = el("h1", {});
  painters.push(() => {
    const { content } = state;
    if (!content || facts.drawn === content) return;
    facts.drawn = content;
    title.textContent = content.title;
    const shown = content.facts.slice(0, 5);
    facts.replaceChildren(...shown.map(([name, value]) => el("span", {}, el("b", {}, value), ` ${value === "1" ? name.replace(/^(mirror|point)s$/, "$1") : name}`)));
  });
  return el("header", {}, el("div", {}, title, facts), el("div", { class: "tools" },
    el("button", { type: "button", id: "theme", onclick: () => theme(!state.dark) }, "light / dark"),
    el("button", { type: "button", onclick: () => window.print() }, "print")));
}

const live = read("live");

async function start() {
  const page = document.getElementById("page");
  theme(matchMedia("(prefers-color-scheme: dark)").matches);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => theme(event.matches));
  try {
    state.content = live ? await loadLive(page) : await unpack(read("content"));
    if (state.content) state.confidence = state.content.least_confidence;
    compose(page);
  } catch (error) {
    page.replaceChildren(el("p", { class: "notice", role: "alert" }, `The content of this page cannot be shown: ${error.message}`));
    throw error;
  }
}

function compose(page) {
  const { stage, panels } = makeStage();
  const remark = el("p", { class: "notice", hidden: true });
  painters.push(() => { if (state.content) { remark.hidden = !state.content.remark; remark.textContent = state.content.remark; } });
  const note = state.content && state.content.points.count < state.content.points.total
    ? el("p", { class: "hint" }, `The strongest ${state.content.points.count} of ${state.content.points.total} points are shown.`) : null;
  const extra = live && typeof makeLive === "function" ? makeLive(panels) : null;
  const pictures = el("main", { class: "card" }, makeBar(), stage, makeLegend(), note,
    el("p", { class: "hint noprint" }, touched ? "Drag the divider to compare; tap the picture to ask what is there, move and zoom it with two fingers."
      : "Drag the divider to compare; drag the picture to move it, zoom with the buttons, or with the wheel once it has been clicked."));
  const under = el("section", { class: "card noprint", id: "under" }, el("h2", {}, touched ? "Under the finger" : "Under the pointer"), makeReadout());
  const tree = el("section", { class: "card" }, el("h2", {}, "Mirrors, by who is seen through whom"), makeTree());
  const display = el("section", { class: "card noprint" }, el("h2", {}, "Display"), makeControls());
  // In the live page the controls of the fold fill the column beside the pictures: what else was there is below these.
  const layout = extra
    ? [el("div", { class: "left" }, pictures, el("div", { class: "pair" }, under, tree)), el("aside", {}, extra.card, display)]
    : [pictures, el("aside", {}, under, tree, display)];
  page.replaceChildren(makeHeader(), extra ? extra.notice : "", remark,
    el("div", { class: "layout" }, layout),
    el("div", { class: "below" }, state.content ? makeSpace() : "",
      el("section", { class: "card full" }, el("h2", {}, "Mirrors at their true places"), makeMirrors()),
      makeScore(),
      makeCommand(),
      el("section", { class: "card full" }, el("h2", {}, "Parameters"), makeParameters())),
    el("footer", {}, `Made by mirrorfold ${state.content ? state.content.version : ""}. Amplitudes are relative to the brightest pixels of the initial image. Lengths in metres, x across, y away from the radar.`));
  window.addEventListener("resize", changed);
  window.addEventListener("beforeprint", () => { state.printing = { mode: state.mode, dark: state.dark }; state.mode = "side"; state.view = null; document.documentElement.dataset.printing = "true"; theme(false); for (const paint of painters) paint(); });
  window.addEventListener("afterprint", () => { const { mode, dark } = state.printing; state.printing = null; delete document.documentElement.dataset.printing; state.mode = mode; state.view = null; theme(dark); });
  changed();
  document.documentElement.dataset.ready = "true";
}

start();
