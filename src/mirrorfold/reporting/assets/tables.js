// Everything in words: what lies under the pointer, the mirrors, the score, the parameters, the command.

function makeReadout() {
  const list = el("dl", { class: "readout", id: "readout", "aria-live": "polite" });
  painters.push(() => {
    const { spot, content } = state;
    if (!content) return;
    const rows = [];
    if (!spot) rows.push([null, `${touched ? "Tap" : "Point at"} a pixel of the images.`]);
    else {
      rows.push(["image", spot.which], ["position", `x ${metres(spot.place[0])}, y ${metres(spot.place[1])}`]);
      rows.push(["amplitude", spot.level === undefined ? "outside" : decibel(spot.level, content.images[spot.which].lowest)]);
      if (spot.passed !== undefined) rows.push(["seen", `through mirror ${content.mirrors[spot.passed].name}, stays`]);
      else if (spot.world === null) rows.push(["seen", "through the edge of a mirror"]);
      else if (spot.world !== undefined) {
        const way = lineage(spot.world).reverse();
        rows.push(["bounces", bouncesText(way.length)]);
        rows.push(["chain", ["radar", ...way.map((mirror) => `mirror ${mirror.name}`)].join(" \u2192 ")]);
        if (spot.seemed && spot.which === "corrected" && way.length) rows.push(["seemed at", spot.seemed.map(placeText).join(", ") + " m"]);
        if (spot.path && spot.which === "initial" && way.length) rows.push(["folds to", spot.path[spot.path.length - 1].map(placeText).join(", ") + " m"]);
      }
      const { points } = content;
      if (spot.point !== null && points.z) rows.push(["height", metres(points.z[spot.point])]);
      rows.push(["confidence", spot.point === null ? "no point here" : fixed(points.confidence[spot.point], 2)]);
      const reason = spot.point === null ? "" : points.reasons[points.reason[spot.point]];
      if (reason) rows.push(["explanation", reason]);
    }
    list.replaceChildren(...rows.flatMap(([name, text]) => (name === null ? [el("dd", { class: "hint" }, text)] : [el("dt", {}, name), el("dd", {}, text)])));
  });
  return list;
}

function table(caption, headings, rows, attributes) {
  const kind = (k) => (headings[k].startsWith("<") ? "text" : "");
  return el("table", {}, el("caption", { class: "sr" }, caption),
    el("thead", {}, el("tr", {}, headings.map((heading, k) => el("th", { scope: "col", class: kind(k) }, heading.replace("<", ""))))),
    el("tbody", {}, rows.map((row, i) => el("tr", attributes ? attributes(i) : {}, row.map((cell, k) => el("td", { class: kind(k) }, cell))))));
}

function makeMirrors() {
  const box = el("div", { class: "wide" });
  let drawn = null;
  painters.push(() => {
    const { content } = state;
    if (!content) return;
    if (drawn !== content) {
      drawn = content;
      const solid = content.mirrors.some((mirror) => mirror.height !== undefined);
      // Columns of their own for what only some mirrors have.
      const more = [["radius", "radius [m]", 1, placeDigits()], ["permittivity", "permittivity", 1, 2], ["thickness", "thickness [mm]", 1000, placeDigits() - 1]]
        .filter(([name]) => content.mirrors.some((mirror) => mirror[name] !== null));
      const measured = (mirror, [name, , scale, digits]) => mirror[name] === null ? "" : fixed(scale * mirror[name], digits)
        + (mirror[`${name}_error`] === null ? "" : `\u00a0\u00b1\u00a0${fixed(scale * mirror[`${name}_error`], digits)}`);
      const headings = ["<mirror", "<seen through", "length [m]", ...(solid ? ["height [m]"] : []), "angle [\u00b0]", "\u00b1 [\u00b0]", "offset \u00b1 [mm]", "strength [dB]", "filled", ...more.map(([, heading]) => heading), "<ends [m]"];
      const rows = content.mirrors.map((mirror) => [mirror.name, mirror.parent < 0 ? "radar" : `mirror ${content.mirrors[mirror.parent].name}`,
        placeText(mirror.length), ...(solid ? [fixed(mirror.height, placeDigits() - 1)] : []), fixed(mirror.angle, 2), fixed(mirror.angle_error, 3),
        fixed(mirror.offset_error === null ? null : 1000 * mirror.offset_error, placeDigits() - 1), fixed(mirror.strength_db, 1), fixed(mirror.fill, 2),
        ...more.map((column) => measured(mirror, column)),
        mirror.folded_ends.map((end) => `(${end.map(placeText).join(", ")})`).join(" \u2013 ")]);
      box.replaceChildren(content.mirrors.length
        ? table("Mirrors at their true places", headings, rows, (i) => ({ "data-number": String(i), ...lights(i) }))
        : el("p", {}, "No mirror was found; the scene is shown unfolded."));
      content.mirrors.forEach((mirror, i) => {
        box.querySelectorAll("tbody tr")[i].firstChild.replaceChildren(
          el("span", { class: "swatch", style: { background: mirrorColour(mirror), marginRight: "9px" } }), mirror.name);
      });
    }
    for (const row of box.querySelectorAll("tbody tr")) row.classList.toggle("lit", Number(row.dataset.number) === state.lit);
  });
  return box;
}

function makeScore() {
  const box = el("section", { class: "card full" });
  painters.push(() => {
    const score = state.content && state.content.score;
    box.hidden = !score;
    if (!score || box.drawn === score) return;
    box.drawn = score;
    const bent = score.mirrors.some((row) => row[4] !== "-");
    box.replaceChildren(el("h2", {}, "Against the truth"), el("div", { class: "space" },
      el("div", { class: "wide" }, table("Points against the truth", ["<points", "all surfaces", "out of sight"], score.points)),
      el("div", { class: "wide" }, table("Mirrors against the truth", ["<mirror", "<true surface", "angle error [\u00b0]", "offset error [mm]", ...(bent ? ["curvature error [%]"] : [])],
        score.mirrors.map(([number, ...rest]) => [state.content.mirrors[number].name, ...rest.slice(0, bent ? 4 : 3)])))));
  });
  return box;
}

// The settings of each step with unit and meaning, then all other attributes of the file.
function makeParameters() {
  const box = el("div", {});
  painters.push(() => {
    const { content } = state;
    if (!content || box.drawn === content) return;
    box.drawn = content;
    const rows = content.settings.map(({ step, label, value, unit, meaning }) => [step, label, value.replace(/^-/, MINUS), unit, meaning]);
    box.replaceChildren(
      ...(rows.length ? [el("div", { class: "wide settings" }, table("Settings", ["<step", "<setting", "value", "<unit", "<meaning"], rows))] : []),
      el("dl", { class: "parameters" }, content.parameters.map(([name, value]) => el("div", {}, el("dt", {}, name.replaceAll("_", " ")), el("dd", {}, value)))));
  });
  return box;
}

function makeCommand() {
  const code = el("code", { tabindex: "0" });
  const copy = el("button", { type: "button", onclick: async () => {
    try { await navigator.clipboard.writeText(code.textContent); copy.textContent = "copied"; }
    catch { getSelection().selectAllChildren(code); copy.textContent = "selected"; }
    setTimeout(() => { copy.textContent = "copy"; }, 1500);
  } }, "copy");
  const box = el("section", { class: "card full" }, el("h2", {}, "Command"), el("div", { class: "command" }, code, copy));
  painters.push(() => {
    box.hidden = !state.content || !state.content.command;
    code.textContent = box.hidden ? "" : state.content.command;
  });
  return box;
}
