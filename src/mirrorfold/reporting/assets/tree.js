// The tree of mirrors: who is seen through whom. A node that is pointed at, or has the focus, lights its mirror.

function makeTree() {
  const layer = svg("svg", { class: "tree", role: "tree", "aria-label": "tree of mirrors" });
  const NARROWEST = 246, HIGH = 44, ROW = 52, INDENT = 34, BESIDE = 33;
  const ink = document.createElement("canvas").getContext("2d");
  let drawn = null;
  painters.push(() => {
    const { content } = state;
    if (!content) return;
    if (drawn !== content) {
      drawn = content;
      draw(content);
    }
    for (const node of layer.querySelectorAll(".node")) {
      const number = Number(node.dataset.number);
      node.classList.toggle("lit", number >= 0 && state.lit === number);
    }
  });

  function draw({ mirrors, seen }) {
    const nodes = new Map(), links = [];
    let row = 0, deepest = 0;
    // Depth first, as a folder shows what is in it.
    (function place(number, depth) {
      deepest = Math.max(deepest, depth);
      nodes.set(number, { x: depth * INDENT + 2, y: row++ * ROW + 3 });
      for (const child of mirrors.filter((mirror) => mirror.parent === number)) {
        links.push([number, child.number]);
        place(child.number, depth + 1);
      }
    })(-1, 0);
    const words = new Map([...nodes.keys()].map((number) => {
      const mirror = mirrors[number], chain = mirror ? mirror.chain : "", [objects, walls] = Object.hasOwn(seen, chain) ? seen[chain] : [0, 0];
      return [number, [mirror ? `mirror ${mirror.name}, ${fixed(mirror.length, placeDigits() - 1)} m` : "radar", `points: ${objects} of objects, ${walls} of walls`]];
    }));
    // As the style sheet draws the second line.
    ink.font = `11.5px ${getComputedStyle(document.body).fontFamily}`;
    const wide = Math.max(NARROWEST, ...[...words.values()].map(([, more]) => BESIDE + ink.measureText(more).width + 14));
    const width = deepest * INDENT + wide + 4, height = row * ROW;
    layer.setAttribute("viewBox", `0 0 ${width} ${height}`);
    layer.style.maxWidth = `${width}px`;
    const parts = links.map(([from, to]) => {
      const a = nodes.get(from), b = nodes.get(to), x = a.x + 18, y = b.y + HIGH / 2;
      return svg("path", { class: "link", d: `M${x},${a.y + HIGH}V${y - 8}Q${x},${y} ${x + 8},${y}H${b.x}` });
    });
    for (const [number, { x, y }] of nodes) {
      const mirror = mirrors[number], [what, more] = words.get(number);
      parts.push(svg("g", { class: "node", tabindex: mirror ? "0" : undefined, role: "treeitem", "data-number": String(number),
        "aria-level": String(mirror ? mirror.generation + 1 : 1), "aria-label": `${what}, ${more}`, ...(mirror ? lights(number) : {}) },
        svg("rect", { class: "pill", x, y, width: wide, height: HIGH, rx: 10 }),
        svg("circle", { cx: x + 18, cy: y + HIGH / 2, r: 6.5, fill: mirror ? mirrorColour(mirror) : "currentColor" }),
        svg("text", { class: "what", x: x + BESIDE, y: y + 19 }, what),
        svg("text", { class: "more", x: x + BESIDE, y: y + 35 }, more)));
    }
    layer.replaceChildren(...parts);
  }
  return layer;
}
