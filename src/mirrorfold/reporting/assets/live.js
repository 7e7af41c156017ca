// The live page: settings, mirrors that can be switched off, moved and drawn, and saving. Every change asks the server
// for a new fold; while one is under way only the latest change waits.

const edit = { settings: {}, lines: null, busy: false, again: false, took: null, message: "", saved: null, steps: [], at: 0 };
const MOST_STEPS = 60;
const PAGE = crypto.randomUUID();  // folds of this page are stopped by this name

// The link that opened the page works once: what stays is the address, and the cookie that came with the page.
history.replaceState(null, "", location.pathname);
addEventListener("pagehide", () => { if (edit.busy) ask("api/cancel", { page: PAGE }, { keepalive: true }).catch(() => {}); });

async function ask(path, request, more = {}) {
  const options = request === undefined ? {} : { ...more, method: "POST", body: JSON.stringify(request),
    headers: { "Content-Type": "application/json", [live.header]: live.token } };
  let response, answer;
  try {
    response = await fetch(path, options);
    answer = await response.json();
  } catch { throw new Error("The program that serves this page does not answer any more; start it again."); }
  if (!response.ok) throw Object.assign(new Error(answer.message), { conflict: response.status === 409 });
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
      return adopt(found.document, await unpack(found.document));
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
function adopt(found, content) {
  edit.settings = { ...found.values };
  edit.lines = found.lines && found.lines.map((points) => ({ points, on: true }));
  edit.controls = found.controls;
  edit.name = found.save_as;
  edit.note = found.note;
  edit.editable = found.editable;
  edit.first = { settings: { ...found.values }, lines: copied(edit.lines), content };
  edit.steps = [edit.first];
  // Side by side: the divider of the swipe would hide mirrors that are to be moved.
  if (edit.editable) state.mode = "side";
  return content;
}

// Undo and redo: every step holds the settings, the lines, and once it is folded what it shows. What one movement of the
// hand changes, such as a mirror that is dragged, is one step: it hands over the same `gesture`.
const copied = (all) => all && all.map(({ points, on }) => ({ points: points.map((point) => [...point]), on }));
function remember(gesture, content = null) {
  const same = gesture && edit.steps[edit.at].gesture === gesture;
  if (!same && ++edit.at > MOST_STEPS) edit.steps.splice(0, edit.at-- - MOST_STEPS);
  edit.steps.splice(edit.at, Infinity, { settings: { ...edit.settings }, lines: copied(edit.lines), content, gesture });
}
function goTo(at) {
  if (!edit.steps[at]) return;
  const { settings, lines, content } = edit.steps[at];
  Object.assign(edit, { at, settings: { ...settings }, lines: copied(lines), message: "", took: null, saved: null });
  edit.showSettings();
  if (content) show(content); else refold();
}
// Take a fold for what is shown; where the least confidence has changed, the slider follows.
function take(content) {
  const same = content.least_confidence === state.content.least_confidence;
  Object.assign(state, { content, confidence: same ? state.confidence : content.least_confidence, lit: null, spot: null });
}
function show(content) {
  take(content);
  if (content.truth.length && !content.score) scoreLater();
  changed();
}
function startOver() {
  const { settings, lines, content } = edit.first;
  Object.assign(edit, { settings: { ...settings }, lines: copied(lines) });
  remember(null, content);
  goTo(edit.at);
}
document.addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  if (!(event.ctrlKey || event.metaKey) || !["z", "y"].includes(key) || event.target.matches("input[type=text], input[type=number]")) return;
  event.preventDefault();
  goTo(edit.at + (key === "y" || event.shiftKey ? 1 : -1));
});

// The lines as they are now: those given, or those that were found. Each has its two ends, an arc a point between them.
const pointsOf = ({ ends: [a, b], through }) => (through ? [a, through, b] : [a, b]);
const lines = () => edit.lines || copied(state.content.mirrors.map((mirror) => ({ points: pointsOf(mirror), on: true })));
const endsOf = ({ points }) => [points[0], points.at(-1)];
const middlePoint = (line) => (line.points.length > 2 ? line.points[1] : middleOf(line.points));
const request = () => ({ page: PAGE, settings: edit.settings, mirrors: edit.lines && edit.lines.filter((line) => line.on).map((line) => line.points) });

async function refold() {
  if (edit.busy) { edit.again = true; return; }
  edit.busy = true;
  edit.saved = null;
  let failure = null;
  try {
    do {
      edit.again = false;
      const start = performance.now(), step = edit.steps[edit.at], answer = await ask("api/fold", request());
      const content = await unpack(answer);
      content.images.initial = state.content.images.initial;
      if (step.lines) nameByLine(content, answer.line_of, step.lines);
      step.content = content;
      const now = edit.steps[edit.at];
      if (now !== step && now.content) continue;
      take(content);
      edit.message = "";
      edit.took = performance.now() - start;
      changed();
      // The number of folds that are drawn: this runs in the same frame, after the painters.
      requestAnimationFrame(() => { document.documentElement.dataset.folds = String(Number(document.documentElement.dataset.folds || 0) + 1); });
    } while (edit.again);
  } catch (error) { failure = error; }
  edit.busy = false;
  if (failure) {
    // What was stopped is not shown: the page goes back to the last step that is.
    if (failure.conflict && !edit.again) goTo(edit.steps.findLastIndex(({ content }, at) => content && at <= edit.at));
    edit.message = failure.message;
  }
  if (edit.again) refold();
  else if (state.content.truth.length && !state.content.score) scoreLater();
  changed();
}
// A mirror is called by the number of its line; where a line was cut into several, with a letter.
function nameByLine(content, lineOf, all) {
  const numbers = all.flatMap((line, k) => (line.on ? [k] : [])), count = {};
  content.used = new Set(lineOf.map((place) => numbers[place]));
  content.mirrors.forEach((mirror, i) => {
    const k = numbers[lineOf[i]], piece = (count[k] = (count[k] || 0) + 1) - 1;
    mirror.name = lineOf.filter((place) => numbers[place] === k).length > 1 ? `${k}${String.fromCharCode(97 + piece)}` : String(k);
  });
}
const used = (k) => !state.content.used || state.content.used.has(k);
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
function change(act, gesture) {
  edit.lines = lines();
  act(edit.lines);
  remember(gesture);
  refold();
  changed();
}

// Handles at both ends and the middle of every line of the initial image.
function handlesOf(panel) {
  if (!edit.editable || !state.show.mirrors) return [];
  return lines().flatMap((line, k) => {
    const ends = endsOf(line), spots = [...ends, middlePoint(line)].map((point) => panel.toScreen(point)), parts = [];
    const [mx, my] = spots[2], off = !line.on || !used(k);
    const points = panel.polyline(curveOf(ends, line.points.length > 2 ? line.points[1] : null));
    if (edit.lines) parts.push(svg("polyline", { class: off ? "unused" : "given", points, fill: "none", stroke: "currentColor", "stroke-width": 1.4, "stroke-dasharray": off ? "1 7" : "2 4" }));
    if (off) parts.push(svg("text", { class: "haloed unused", x: mx, y: my - 10, "text-anchor": "middle" }, `${k} not used`));
    if (!line.on) return parts;
    for (const [i, [x, y]] of spots.entries())
      parts.push(svg(i < 2 ? "circle" : "rect", { class: "handle", stroke: "currentColor", tabindex: "0", role: "slider",
        "data-handle": `${k}-${i}`, "aria-label": `${i < 2 ? `end ${i} of` : "all of"} mirror ${k}: arrow keys move it, shift makes small steps`,
        "aria-valuetext": (i < 2 ? [ends[i]] : ends).map((end) => end.map(placeText).join(", ")).join("; "), "aria-valuenow": "0",
        ...(i < 2 ? { cx: x, cy: y, r: 5.5 } : { x: x - 4.5, y: y - 4.5, width: 9, height: 9, rx: 2 }),
        onpointerdown: (event) => drag(panel, k, i, event), onkeydown: (event) => nudge(k, i, event) }));
    return parts;
  });
}
// Move one end, 0 or 1, or all of a line, 2. An arc is turned and stretched with its ends: it keeps its shape.
function move(k, handle, dx, dy, gesture) {
  change((all) => {
    const before = endsOf(all[k]), after = before.map(([x, y], i) => (handle === 2 || handle === i ? [x + dx, y + dy] : [x, y]));
    const [[ax, ay], [bx, by]] = before, [[px, py], [qx, qy]] = after, sx = bx - ax, sy = by - ay, ss = sx * sx + sy * sy || 1e-12;
    // The turn and the stretch as a complex number.
    const re = ((qx - px) * sx + (qy - py) * sy) / ss, im = ((qy - py) * sx - (qx - px) * sy) / ss;
    const between = all[k].points.slice(1, -1).map(([x, y]) => [px + re * (x - ax) - im * (y - ay), py + im * (x - ax) + re * (y - ay)]);
    all[k].points = [after[0], ...between, after[1]];
  }, gesture);
}
function drag(panel, k, handle, event) {
  if (!drags(event)) return;
  event.preventDefault();
  event.stopPropagation();
  const gesture = {};
  let last = panel.toWorld(panel.place(event));
  followPointer(event, (moved) => {
    const now = panel.toWorld(panel.place(moved));
    move(k, handle, now[0] - last[0], now[1] - last[1], gesture);
    last = now;
  });
}
function nudge(k, handle, event) {
  const size = roundStep(state.content.grid.dx) * (event.shiftKey ? 0.1 : 1);
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (!step) return;
  event.preventDefault();
  move(k, handle, size * step[0], size * step[1]);
}

// Draw a mirror by hand: press at one end, let go at the other. The button once more, or Escape, ends it.
function setDrawing(button, stage, draw) {
  state.draw = draw;
  button.setAttribute("aria-pressed", String(draw !== null));
  stage.classList.toggle("drawing", draw !== null);
}
function startDrawing(button, stage) {
  setDrawing(button, stage, (panel, event) => {
    setDrawing(button, stage, null);
    if (panel.which !== "initial") { edit.message = "Draw in the initial image: that is where mirrors are seen."; changed(); return; }
    const start = panel.toWorld(panel.place(event)), before = edit.lines, line = { points: [start, [...start]], on: true };
    edit.lines = [...lines(), line];
    followPointer(event, (moved) => { line.points = [start, panel.toWorld(panel.place(moved))]; changed(); }, () => {
      const [a, b] = line.points.map((end) => panel.toScreen(end));
      if (Math.hypot(a[0] - b[0], a[1] - b[1]) < 8) edit.lines = before; else { remember(); refold(); }
      changed();
    });
    changed();
  });
}
// Without a pointer: a line across the middle of the picture, to be moved by its handles.
function insertLine(panel) {
  const k = lines().length, y = panel.height / 2 + 14 * (k % 6);
  change((all) => all.push({ points: [0.4, 0.6].map((share) => panel.toWorld([share * panel.width, y])), on: true }));
  requestAnimationFrame(() => panel.layer.querySelector(`[data-handle="${k}-2"]`)?.focus({ preventScroll: true }));
}

// A row for one setting, as the server describes its control; `show` sets it to the value that is in force.
function makeSetting({ name, label, unit, meaning, works, kind, choices, lowest, highest, step }) {
  const id = `set-${name}`, shown = el("output", { for: id });
  const digits = step ? Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) : 4;
  const say = (value) => { shown.textContent = kind === "range" ? `${fixed(value, digits)} ${unit}` : kind === "number" ? unit : ""; };
  let gesture = {};
  const take = (value) => { edit.settings[name] = value; say(value); remember(gesture); refold(); };
  const makers = {
    switch: () => el("input", { type: "checkbox", id, onchange: (event) => { gesture = {}; take(event.target.checked); } }),
    choice: () => el("select", { id, onchange: (event) => { gesture = {}; take(choices[event.target.selectedIndex]); } },
      choices.map((value) => el("option", {}, value === null ? "default" : String(value)))),
    range: () => el("input", { type: "range", id, min: String(lowest), max: String(highest), step: String(step),
      oninput: (event) => take(Number(event.target.value)), onchange: () => { gesture = {}; } }),
    number: () => el("input", { type: "number", id, step: "any", placeholder: "default",
      onchange: (event) => { gesture = {}; take(event.target.value === "" ? null : Number(event.target.value)); } }),
  };
  const input = makers[kind]();
  input.disabled = !works;
  const show = () => {
    const value = edit.settings[name];
    if (kind === "switch") input.checked = value;
    else if (kind === "choice") input.selectedIndex = choices.indexOf(value);
    else input.value = value === null ? "" : String(value);
    say(value);
  };
  show();
  return { row: el("label", { class: kind === "switch" ? "control switch" : "control", title: meaning }, el("span", {}, label), input, shown), show };
}

function makeLive(panels) {
  const message = el("p", { class: "notice", role: "alert", hidden: true });
  painters.push(() => { message.hidden = !edit.message; message.textContent = edit.message; });
  const notice = el("div", {}, message, edit.note ? el("p", { class: "notice", role: "note" }, edit.note) : null);
  if (!edit.editable) {
    const words = "The mirrors of a volume cannot be moved here. What is shown can be chosen by bounces and confidence.";
    return { notice, card: el("section", { class: "card" }, el("h2", {}, "Fold"), el("p", { class: "hint" }, words)) };
  }
  panels[0].handles = () => handlesOf(panels[0]);
  const settings = edit.controls.map(makeSetting);
  const list = el("div", { class: "legend", id: "lines" });
  const stage = panels[0].node.parentNode;
  const pencil = el("button", { type: "button", id: "draw", "aria-pressed": "false",
    title: "press at one end and let go at the other; the key Enter inserts a line, which the arrow keys move",
    onclick: (event) => {
      if (state.draw) setDrawing(pencil, stage, null);
      else if (event.detail === 0) insertLine(panels[0]); // pressed by a key
      else startDrawing(pencil, stage);
    } }, "draw a mirror");
  document.addEventListener("keydown", (event) => { if (event.key === "Escape") setDrawing(pencil, stage, null); });
  edit.showSettings = () => settings.forEach((setting) => setting.show());
  const undo = el("button", { type: "button", id: "undo", title: "Ctrl+Z", onclick: () => goTo(edit.at - 1) }, "undo");
  const redo = el("button", { type: "button", id: "redo", title: "Ctrl+Y or Ctrl+Shift+Z", onclick: () => goTo(edit.at + 1) }, "redo");
  const again = el("button", { type: "button", id: "find", title: "the file as it was opened", onclick: startOver }, "start over");
  const took = el("p", { class: "hint", role: "status", id: "took" });
  const cancel = el("button", { type: "button", id: "cancel", hidden: true, onclick: () => { edit.again = false; ask("api/cancel", { page: PAGE }).catch(() => {}); } }, "stop folding");
  const name = el("input", { type: "text", id: "save-name", "aria-label": "name of the file to save", value: edit.name });
  const saved = el("div", { id: "saved", role: "status" });
  const save = el("button", { type: "button", id: "save", onclick: async () => {
    save.disabled = true;
    const replace = save.replaces === name.value;
    save.replaces = null;
    try { edit.saved = await ask("api/save", { ...request(), name: name.value, replace }); edit.message = ""; }
    catch (error) { edit.message = error.message; edit.saved = null; if (error.conflict) save.replaces = name.value; }
    save.disabled = false;
    if (document.activeElement === document.body) save.focus();
    changed();
  } }, "save");
  let drawn = null;
  painters.push(() => {
    const pressed = document.activeElement;
    undo.disabled = !edit.steps[edit.at - 1];
    redo.disabled = !edit.steps[edit.at + 1];
    again.disabled = state.content === edit.first.content;
    // A button that is switched off hands the focus to one that is not.
    if (pressed.disabled) [undo, redo].find((button) => [undo, redo, again].includes(pressed) && !button.disabled)?.focus();
    const all = lines(), key = JSON.stringify(all.map((line, k) => [line.on, used(k)]));
    if (drawn !== key) {
      drawn = key;
      const held = list.contains(pressed) ? pressed.dataset.line : null;
      list.replaceChildren(...all.map((line, k) => el("label", { class: line.on && used(k) ? "" : "unused" }, el("input", { type: "checkbox", "data-line": String(k), checked: line.on,
        onchange: (event) => change((now) => { now[k].on = event.target.checked; }) }), `mirror ${k}${line.on && !used(k) ? ", not used" : ""}`)));
      if (held !== null) list.querySelector(`[data-line="${held}"]`)?.focus({ preventScroll: true });
    }
    cancel.hidden = !edit.busy;
    took.textContent = edit.busy ? "folding \u2026" : state.content === edit.first.content ? "as it is in the file"
      : edit.took === null ? "" : `folded in ${Math.round(edit.took)} ms${edit.lines ? ", with these mirrors" : ""}`;
    if (saved.drawn !== edit.saved) {
      saved.drawn = edit.saved;
      saved.replaceChildren(...(edit.saved ? [el("p", { class: "hint" }, `saved ${edit.saved.files.join(", ")}${edit.saved.command ? "; the same again:" : ""}`),
        edit.saved.command ? el("pre", { tabindex: "0" }, edit.saved.command) : ""] : []));
    }
  });
  return { notice, card: el("section", { class: "card noprint" }, el("h2", {}, "Fold"), settings.map((setting) => setting.row),
    list, el("div", { class: "row" }, pencil, undo, redo, again), el("div", { class: "row" }, took, cancel), el("div", { class: "row" }, name, save), saved) };
}
