// The live page: settings, mirrors that can be switched off, moved and drawn, and saving. Every change asks the server
// for a new fold; while one is under way only the latest change waits.

const edit = { settings: {}, lines: null, busy: false, again: false, took: null, message: "", saved: null };

async function ask(path, request) {
  const options = request === undefined ? {} : { method: "POST", body: JSON.stringify(request),
    headers: { "Content-Type": "application/json", [live.header]: live.token } };
  let response, answer;
  try {
    response = await fetch(path, options);
    answer = await response.json();
  } catch { throw new Error("The program that serves this page does not answer any more; start it again."); }
  if (!response.ok) throw new Error(answer.message);
  return answer;
}

// Wait until the file is open, telling how it goes; a file that cannot be read is told of, and can be tried again.
async function loadLive(page) {
  const title = el("h1", {}, document.title.replace(/ - mirrorfold$/, "")), step = el("p", { class: "lead", role: "status" });
  const bar = el("progress", { max: "1", "aria-label": "progress" });
  page.replaceChildren(el("header", {}, el("div", {}, title, step)), bar);
  for (;;) {
    const found = await ask("api/state");
    if (found.status === "ready") {
      adopt(found.document);
      return unpack(found.document);
    }
    if (found.status === "failed") {
      await new Promise((again) => {
        page.replaceChildren(el("header", {}, el("div", {}, title)), el("p", { class: "notice", role: "alert" }, found.message),
          el("button", { type: "button", id: "again", onclick: again }, "try again"));
        document.documentElement.dataset.ready = "failed";
      });
      await ask("api/open", {});
      page.replaceChildren(el("header", {}, el("div", {}, title, step)), bar);
      continue;
    }
    step.textContent = `${found.step} \u2026`;
    if (found.done > 0) bar.value = found.done / found.total; else bar.removeAttribute("value");
    await new Promise((done) => setTimeout(done, 150));
  }
}
function adopt(found) {
  edit.settings = { ...found.values };
  edit.controls = found.controls;
  edit.name = found.save_as;
  edit.editable = found.editable;
  edit.found = { ...found.values };
  // Side by side: the divider of the swipe would hide mirrors that are to be moved.
  if (edit.editable) state.mode = "side";
}

// The lines as they are now: those given, or those that were found.
const lines = () => edit.lines || state.content.mirrors.map((mirror) => ({ ends: mirror.ends.map((end) => [...end]), on: true }));
const request = () => ({ settings: edit.settings, mirrors: edit.lines && edit.lines.filter((line) => line.on).map((line) => line.ends) });

async function refold() {
  if (edit.busy) { edit.again = true; return; }
  edit.busy = true;
  edit.saved = null;
  try {
    do {
      edit.again = false;
      const start = performance.now(), answer = await ask("api/fold", request());
      const content = await unpack(answer);
      content.images.initial = state.content.images.initial;
      // For each mirror the number of the line that it lies on.
      content.line_of = answer.line_of;
      state.content = content;
      state.lit = null;
      state.spot = null;
      edit.message = "";
      edit.took = performance.now() - start;
      document.documentElement.dataset.folds = String(Number(document.documentElement.dataset.folds || 0) + 1);
      changed();
    } while (edit.again);
  } catch (error) { edit.message = error.message; }
  edit.busy = false;
  if (edit.again) refold();
  else if (state.content.truth.length) scoreLater();
  changed();
}
// The score takes longer than a fold: it follows when the hand rests.
function scoreLater() {
  clearTimeout(edit.timer);
  const { content } = state;
  edit.timer = setTimeout(async () => {
    if (edit.busy || state.content !== content) return;
    try { content.score = (await ask("api/fold", { ...request(), score: true })).score; } catch { return; }
    changed();
  }, 700);
}
function change(act) {
  edit.lines = lines();
  act(edit.lines);
  refold();
  changed();
}

// Handles at both ends and the middle of every line of the initial image.
function handlesOf(panel) {
  if (!edit.editable || !state.show.mirrors) return [];
  return lines().flatMap((line, k) => {
    const screen = line.ends.map((end) => panel.toScreen(end)), parts = [];
    if (edit.lines) parts.push(svg("line", { x1: screen[0][0], y1: screen[0][1], x2: screen[1][0], y2: screen[1][1],
      stroke: "currentColor", "stroke-width": 1.4, "stroke-dasharray": line.on ? "2 4" : "1 7" }));
    if (!line.on) return parts;
    const spots = [[screen[0], [0]], [screen[1], [1]], [[0, 1].map((c) => (screen[0][c] + screen[1][c]) / 2), [0, 1]]];
    for (const [i, [[x, y], which]] of spots.entries())
      parts.push(svg(i < 2 ? "circle" : "rect", { class: "handle", stroke: "currentColor", tabindex: "0", role: "slider",
        "data-handle": `${k}-${i}`, "aria-label": `${i < 2 ? `end ${i} of` : "all of"} mirror ${k}: arrow keys move it, shift makes small steps`,
        "aria-valuetext": which.map((w) => line.ends[w].map((v) => fixed(v, 3)).join(", ")).join("; "), "aria-valuenow": "0",
        ...(i < 2 ? { cx: x, cy: y, r: 5.5 } : { x: x - 4.5, y: y - 4.5, width: 9, height: 9, rx: 2 }),
        onpointerdown: (event) => drag(panel, k, which, event), onkeydown: (event) => nudge(k, which, event) }));
    return parts;
  });
}
function move(k, which, dx, dy) {
  change((all) => { for (const w of which) { all[k].ends[w][0] += dx; all[k].ends[w][1] += dy; } });
}
function drag(panel, k, which, event) {
  event.preventDefault();
  event.stopPropagation();
  let last = panel.toWorld(panel.place(event));
  const follow = (moved) => {
    const now = panel.toWorld(panel.place(moved));
    move(k, which, now[0] - last[0], now[1] - last[1]);
    last = now;
  };
  window.addEventListener("pointermove", follow);
  window.addEventListener("pointerup", () => window.removeEventListener("pointermove", follow), { once: true });
}
function nudge(k, which, event) {
  const size = event.shiftKey ? 0.001 : 0.01;
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (!step) return;
  event.preventDefault();
  move(k, which, size * step[0], size * step[1]);
}

// Draw a mirror by hand: press at one end, let go at the other.
function startDrawing(button) {
  state.draw = (panel, event) => {
    state.draw = null;
    button.setAttribute("aria-pressed", "false");
    if (panel.which !== "initial") { edit.message = "Draw in the initial image: that is where mirrors are seen."; changed(); return; }
    const start = panel.toWorld(panel.place(event));
    edit.lines = lines();
    const line = { ends: [start, [...start]], on: true };
    edit.lines.push(line);
    const follow = (moved) => { line.ends = [start, panel.toWorld(panel.place(moved))]; changed(); };
    window.addEventListener("pointermove", follow);
    window.addEventListener("pointerup", () => {
      window.removeEventListener("pointermove", follow);
      if (Math.hypot(line.ends[1][0] - start[0], line.ends[1][1] - start[1]) < 0.01) edit.lines.splice(edit.lines.indexOf(line), 1);
      refold();
    }, { once: true });
    changed();
  };
}

// A row for one setting, as the server describes its control; `show` sets it to the value that is in force.
function makeSetting({ name, label, unit, meaning, kind, choices, lowest, highest, step }) {
  const id = `set-${name}`, shown = el("output", { for: id });
  const digits = step ? Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) : 4;
  const say = (value) => { shown.textContent = kind === "range" ? `${fixed(value, digits)} ${unit}` : kind === "number" ? unit : ""; };
  const take = (value) => { edit.settings[name] = value; say(value); refold(); };
  const makers = {
    switch: () => el("input", { type: "checkbox", id, onchange: (event) => take(event.target.checked) }),
    choice: () => el("select", { id, onchange: (event) => take(choices[event.target.selectedIndex]) },
      choices.map((value) => el("option", {}, value === null ? "default" : String(value)))),
    range: () => el("input", { type: "range", id, min: String(lowest), max: String(highest), step: String(step),
      oninput: (event) => take(Number(event.target.value)) }),
    number: () => el("input", { type: "number", id, step: "any", placeholder: "default",
      onchange: (event) => take(event.target.value === "" ? null : Number(event.target.value)) }),
  };
  const input = makers[kind]();
  const show = () => {
    const value = edit.settings[name];
    if (kind === "switch") input.checked = value;
    else if (kind === "choice") input.selectedIndex = choices.indexOf(value);
    else input.value = value === null ? "" : String(value);
    say(value);
  };
  show();
  return { row: el("label", { class: "control", title: meaning }, el("span", {}, label), input, shown), show };
}

function makeLive(panels) {
  const notice = el("p", { class: "notice", role: "alert", hidden: true });
  painters.push(() => { notice.hidden = !edit.message; notice.textContent = edit.message; });
  if (!edit.editable) {
    const words = "The mirrors of a volume cannot be moved here. What is shown can be chosen by bounces and confidence.";
    return { notice, card: el("section", { class: "card" }, el("h2", {}, "Fold"), el("p", { class: "hint" }, words)) };
  }
  panels[0].handles = () => handlesOf(panels[0]);
  const settings = edit.controls.map(makeSetting);
  const list = el("div", { class: "legend", id: "lines" });
  const pencil = el("button", { type: "button", id: "draw", "aria-pressed": "false", onclick: () => { pencil.setAttribute("aria-pressed", "true"); startDrawing(pencil); } }, "draw a mirror");
  const again = el("button", { type: "button", id: "find", onclick: () => {
    edit.lines = null;
    edit.settings = { ...edit.found };
    settings.forEach((setting) => setting.show());
    refold();
  } }, "start over");
  const took = el("p", { class: "hint", role: "status", id: "took" });
  const name = el("input", { type: "text", id: "save-name", "aria-label": "name of the file to save", value: edit.name });
  const saved = el("div", { id: "saved", role: "status" });
  const save = el("button", { type: "button", id: "save", onclick: async () => {
    save.disabled = true;
    try { edit.saved = await ask("api/save", { ...request(), name: name.value }); edit.message = ""; }
    catch (error) { edit.message = error.message; edit.saved = null; }
    save.disabled = false;
    changed();
  } }, "save");
  let drawn = null;
  painters.push(() => {
    const all = lines(), key = JSON.stringify(all.map((line) => line.on));
    if (drawn !== key) {
      drawn = key;
      list.replaceChildren(...all.map((line, k) => el("label", {}, el("input", { type: "checkbox", "data-line": String(k), checked: line.on,
        onchange: (event) => change((now) => { now[k].on = event.target.checked; }) }), `mirror ${k}`)));
    }
    took.textContent = edit.busy ? "folding \u2026" : edit.took === null ? (edit.lines ? "" : "as it was found")
      : `folded in ${Math.round(edit.took)} ms${edit.lines ? ", with these mirrors" : ""}`;
    if (saved.drawn !== edit.saved) {
      saved.drawn = edit.saved;
      saved.replaceChildren(...(edit.saved ? [el("p", { class: "hint" }, `saved ${edit.saved.files.join(", ")}; the same again:`), el("pre", { tabindex: "0" }, edit.saved.command)] : []));
    }
  });
  return { notice, card: el("section", { class: "card noprint" }, el("h2", {}, "Fold"), settings.map((setting) => setting.row),
    list, el("div", { class: "row" }, pencil, again), took, el("div", { class: "row" }, name, save), saved) };
}
