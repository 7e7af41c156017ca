// What lies under the pointer: its amplitude, and the way that the waves took by way of mirrors, flat or curved.

const ARC_POINTS = 49, STRAIGHT = 1e-6; // as in Python, see common/arcs.py

const middleOf = ([a, b]) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];

// Middle and radius of the circle through three points; null where they lie on a line.
function circleThrough([ax, ay], [bx, by], [cx, cy]) {
  const ux = bx - ax, uy = by - ay, vx = cx - ax, vy = cy - ay, uu = ux * ux + uy * uy, vv = vx * vx + vy * vy;
  const twice = 2 * (ux * vy - uy * vx), mx = (vy * uu - uy * vv) / twice, my = (ux * vv - vx * uu) / twice;
  return Math.abs(twice) <= STRAIGHT * vv ? null : { middle: [ax + mx, ay + my], radius: Math.hypot(mx, my) };
}
// The points that a mirror is drawn by: its ends, or those along an arc by way of a third point.
function curveOf(ends, through) {
  const circle = through && circleThrough(ends[0], through, ends[1]);
  if (!circle) return ends;
  const { middle: [x, y], radius } = circle, whole = 2 * Math.PI;
  const [first, half, last] = [ends[0], through, ends[1]].map((p) => Math.atan2(p[1] - y, p[0] - x));
  let turn = (last - first + whole) % whole;
  if ((half - first + whole) % whole > turn) turn -= whole; // the third point lies on the other way around
  return Array.from({ length: ARC_POINTS }, (_, i) => first + (turn * i) / (ARC_POINTS - 1))
    .map((angle) => [x + radius * Math.cos(angle), y + radius * Math.sin(angle)]);
}

const reflect = (p, [a, b]) => {
  const nx = a[1] - b[1], ny = b[0] - a[0], k = (2 * ((p[0] - a[0]) * nx + (p[1] - a[1]) * ny)) / (nx * nx + ny * ny);
  return [p[0] - k * nx, p[1] - k * ny];
};

// A mirror and those through which it is seen, up to the root.
function lineage(number) {
  const { mirrors } = state.content, way = [];
  for (let n = number; n >= 0 && way.length <= mirrors.length; n = mirrors[n].parent) way.push(mirrors[n]);
  return way;
}

// Where the line of sight to a place of the unfolded image meets a mirror: at which share of the way, whether on the
// mirror, and the line that reflects it there, the tangent of an arc.
function meeting(mirror, p) {
  const { radar } = state.content, dx = p[0] - radar[0], dy = p[1] - radar[1];
  const [[ax, ay], [bx, by]] = mirror.ends, sx = bx - ax, sy = by - ay;
  const circle = mirror.through && circleThrough(mirror.ends[0], mirror.through, mirror.ends[1]);
  if (!circle) {
    const turn = dx * sy - dy * sx, along = ((ax - radar[0]) * sy - (ay - radar[1]) * sx) / turn;
    const beside = ((ax - radar[0]) * dy - (ay - radar[1]) * dx) / turn;
    return { along, on: along > 0 && beside >= 0 && beside <= 1, line: mirror.ends };
  }
  const { middle: [cx, cy], radius } = circle, ox = radar[0] - cx, oy = radar[1] - cy, way = dx * dx + dy * dy;
  const nearest = -(ox * dx + oy * dy) / way, half = nearest * nearest - (ox * ox + oy * oy - radius * radius) / way;
  // The arc is the part of the circle on one side of its chord.
  const side = ([x, y]) => Math.sign(sx * (y - ay) - sy * (x - ax)), root = Math.sqrt(Math.max(half, 0));
  const met = [nearest - root, nearest + root].map((along) => [along, [radar[0] + along * dx, radar[1] + along * dy]]);
  const hit = half >= 0 ? met.find(([along, q]) => along > 0 && side(q) === side(mirror.through)) : undefined;
  const [along, [x, y]] = hit || met[0];
  return { along, on: hit !== undefined, line: [[x, y], [x - (y - cy), y + (x - cx)]] };
}
const fold = (p, number) => lineage(number).reduce((q, mirror) => reflect(q, meeting(mirror, p).line), p);
// Only by flat mirrors: by arcs, many places of the unfolded image may lead to one.
const flat = (number) => lineage(number).every((mirror) => !mirror.through);
const unfold = (p, number) => lineage(number).reverse().reduce((q, mirror) => reflect(q, mirror.ends), p);

// Walk outward along the straight line of sight of the unfolded image: each mirror crossed opens that mirror's world,
// if its parent's is open. A point just behind a mirror still belongs to its wall.
function sight(p) {
  const { radar, mirrors, margin } = state.content;
  const dx = p[0] - radar[0], dy = p[1] - radar[1], length = Math.hypot(dx, dy);
  const met = [];
  for (const mirror of mirrors) {
    const { along, on } = meeting(mirror, p);
    if (on && along * length < length - margin) met.push([along, mirror]);
  }
  met.sort((one, other) => one[0] - other[0]);
  let world = -1;
  const path = [[radar[0], radar[1]]];
  for (const [along, mirror] of met) {
    if (mirror.parent !== world) return { world: null, path };
    path.push(fold([radar[0] + along * dx, radar[1] + along * dy], mirror.parent));
    world = mirror.number;
  }
  path.push(fold(p, world));
  return { world, path };
}

// What stands at a place of one of the two images: its level, its chain of mirrors, and the path of the waves, folded and
// unfolded. A point at that place tells the chain; without one, in the corrected image, the chain that shows the place
// brightest counts. Nothing stands where no point is within its own resolution cell.
function look(which, p) {
  const { images, grid, points, dimensions, mirrors } = state.content;
  const spot = { which, place: p, level: levelAt(images[which], grid, p[0], p[1]), world: undefined, point: null };
  const worldOf = (i) => points.ways[points.chain[i]].at(-1) ?? -1;
  const nearest = (reach, fits) => {
    let found = null, least = Infinity;
    for (let i = 0; i < points.count; i++) {
      const [x, y] = placeOf(points, i, which), distance = Math.hypot(x - p[0], y - p[1]);
      if (distance < Math.min(least, reach(i)) && pointShown(points, i) && fits(i)) [found, least] = [i, distance];
    }
    return found;
  };
  const cell = (i) => points.cell[i], drawn = Math.max(1.5 * grid.dx, 4 / state.view.scale);
  // What has passed through a wall stays where it is seen.
  const close = nearest(cell, () => true);
  if (dimensions === 2 && close !== null && points.passed[close] !== undefined)
    return { ...spot, point: close, world: worldOf(close), passed: points.passed[close], seemed: p, path: [state.content.radar, p] };
  const here = nearest(() => drawn, () => true);
  if (dimensions === 2 && which === "initial") Object.assign(spot, { seemed: p }, sight(p));
  else if (dimensions === 2) {
    let best = -Infinity;
    for (const number of here !== null ? [worldOf(here)] : [-1, ...mirrors.map((mirror) => mirror.number)]) {
      // What a curved mirror shows seemed to be where the nearest point did that it shows.
      const shown = flat(number) ? null : nearest(cell, (i) => worldOf(i) === number);
      if (!flat(number) && shown === null) continue;
      const seemed = shown === null ? unfold(p, number) : placeOf(points, shown, "initial");
      const found = sight(seemed), level = levelAt(images.initial, grid, ...seemed) ?? -100;
      if (found.world === number && level > best) { best = level; Object.assign(spot, { seemed }, found); }
    }
  }
  spot.point = nearest(cell, (i) => spot.world === undefined || (worldOf(i) === spot.world && points.passed[i] === undefined));
  if (spot.world === undefined && spot.point !== null) spot.world = worldOf(spot.point);
  if (spot.point !== null) spot.passed = points.passed[spot.point];
  return spot;
}
const placeOf = (points, i, which) =>
  which === "initial" ? [points.x_initial[i], points.y_initial[i]] : [points.x[i], points.y[i]];

