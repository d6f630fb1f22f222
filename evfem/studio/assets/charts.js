"use strict";
// Line charts as SVG: one function, no dependency.

const WIDE = 520, HIGH = 230, LEFT = 58, RIGHT = 12, TOP = 26, BOTTOM = 38;

function element(name, attributes, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (text !== undefined) made.textContent = text;
  return made;
}

// Round values that divide a range into about four parts.
function ticks(low, high) {
  const raw = (high - low) / 4, ten = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * ten).find((s) => s >= raw);
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

function shown(value) {
  return String(Number(value.toPrecision(4)));
}

function range(values, least) {
  let low = Math.min(...values), high = Math.max(...values);
  const missing = Math.max(least - (high - low), 0) / 2;
  low -= missing; high += missing;
  const margin = 0.06 * (high - low);
  return [low - margin, high + margin];
}

/* Draw `lines` ({x, y, cls, name}) into a figure. `band` {y, half} is a band around a line, `lost` says
   for each x of the first line whether it is marked; `least` is the smallest range of y. */
function chart(figure, {title, xlabel, lines, band, lost, least = 1e-6}) {
  const x = lines[0].x, all = lines.flatMap((line) => line.y);
  if (band) all.push(...band.y.map((y) => y - band.half), ...band.y.map((y) => y + band.half));
  const [low, high] = range(all, least), [first, last] = [x[0], x[x.length - 1]];
  const px = (v) => LEFT + (v - first) / (last - first) * (WIDE - LEFT - RIGHT);
  const py = (v) => HIGH - BOTTOM - (v - low) / (high - low) * (HIGH - TOP - BOTTOM);
  const svg = element("svg", {viewBox: `0 0 ${WIDE} ${HIGH}`, role: "img",
    "aria-label": `${title}, from ${shown(Math.min(...lines[0].y))} to ${shown(Math.max(...lines[0].y))}`});
  for (const t of ticks(low, high)) {
    svg.append(element("line", {class: "grid", x1: LEFT, x2: WIDE - RIGHT, y1: py(t), y2: py(t)}));
    svg.append(element("text", {x: LEFT - 6, y: py(t) + 4, "text-anchor": "end"}, shown(t)));
  }
  for (const t of ticks(first, last)) {
    svg.append(element("text", {x: px(t), y: HIGH - BOTTOM + 16, "text-anchor": "middle"}, shown(t)));
  }
  if (lost) marked(svg, x, lost, px);
  if (band) {
    const up = band.y.map((y, i) => `${px(x[i]).toFixed(1)},${py(y + band.half).toFixed(1)}`);
    const down = band.y.map((y, i) => `${px(x[i]).toFixed(1)},${py(y - band.half).toFixed(1)}`);
    svg.append(element("polygon", {class: "band", points: up.concat(down.reverse()).join(" ")}));
  }
  lines.forEach((line, i) => {
    const points = line.y.map((y, k) => `${px(line.x[k]).toFixed(1)},${py(y).toFixed(1)}`).join(" ");
    svg.append(element("polyline", {class: line.cls, points}));
    if (line.name) {
      const at = WIDE - RIGHT - 150 + 80 * i;
      svg.append(element("line", {class: line.cls, x1: at, x2: at + 22, y1: 12, y2: 12}));
      svg.append(element("text", {x: at + 27, y: 16}, line.name));
    }
  });
  svg.append(element("text", {class: "title", x: 4, y: 15}, title));
  svg.append(element("text", {x: (LEFT + WIDE) / 2, y: HIGH - 5, "text-anchor": "middle"}, xlabel));
  figure.replaceChildren(svg);
}

function marked(svg, x, lost, px) {
  for (let i = 0; i < lost.length; i++) {
    if (!lost[i]) continue;
    let j = i;
    while (j + 1 < lost.length && lost[j + 1]) j++;
    const from = px(x[i]), to = px(x[j]);
    svg.append(element("rect", {class: "lost", x: from, width: Math.max(to - from, 1.5), y: TOP,
      height: HIGH - TOP - BOTTOM}));
    i = j;
  }
}
