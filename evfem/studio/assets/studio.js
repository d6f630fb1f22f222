"use strict";
// The page: its controls are the state, the state is the link, the answers are the pictures.

const get = (id) => document.getElementById(id);
const DRAWN = 64;
let drawn = Array.from({length: DRAWN}, (_, i) => 0.8 * Math.sin(2 * Math.PI * i / DRAWN));
let upload = null;      // a texture by its rows
let model = null;       // {key, x, friction}: the model's curve, and for which texture and touch
let exact = null;       // {key, x, voltage, friction}: the model's voltage, and for which display as well
let asked = 0, answered = 0, busy = false, again = false;
let running = null;     // AbortController of the model's run

const chosen = () => document.querySelector("input[name=from]:checked").value;
const number = (id) => Number(get(id).value);

function texture() {
  const from = chosen();
  if (from === "dial") {
    const knobs = {generator: get("generator").value, frequency: number("frequency"),
      amplitude: number("amplitude"), irregularity: number("irregularity"), seed: 1};
    if (knobs.generator === "sinusoids") Object.assign(knobs, {second: number("second"), phase: number("phase")});
    return knobs;
  }
  if (from === "draw") {
    const period = number("period"), height = number("height");
    return {name: "drawn", kind: "drawn", licence: "CC0-1.0", period,
      x: drawn.map((_, i) => Number((i * period / DRAWN).toFixed(6))),
      values: drawn.map((v) => Number((0.5 * height * v).toFixed(6)))};
  }
  if (from === "upload" && upload) return upload;
  return {reference: get("reference").value};
}

function state() {
  const most = number("voltage_max");
  return {
    texture: texture(),
    touch: {ridged: get("ridged").value === "1", friction: number("friction"), load: number("load"),
      speed: number("speed"), length: number("length")},
    device: {friction: number("display"), law: get("law").value, insulator: get("insulator").value,
      roughness_gap: number("roughness_gap"), voltage_max: most >= Number(get("voltage_max").max) ? undefined : most},
  };
}

const felt = (now) => JSON.stringify([now.texture, now.touch]);
const shown_by = (now) => JSON.stringify([now.texture, now.touch, now.device]);

// With the model's curve where there is one for this texture and touch.
function whole() {
  const now = state();
  if (model && model.key === felt(now)) now.model = {x: model.x, friction: model.friction};
  if (exact && exact.key === shown_by(now)) now.exact = {x: exact.x, voltage: exact.voltage, friction: exact.friction};
  return now;
}

async function post(path, body, signal) {
  const answer = await fetch(path, {method: "POST", body, signal});
  if (!answer.ok) {
    let said = `the studio's server answered with status ${answer.status}`;
    try { said = (await answer.json()).error; } catch { /* not of ours */ }
    throw new Error(said);
  }
  return answer;
}

function wrong(error) {
  const closed = "the studio's server does not answer; start it again: evfem studio";
  get("error").textContent = error.message === "Failed to fetch" ? closed : error.message;
  get("error").hidden = false;
  get("error").scrollIntoView({block: "nearest"});
}

// One question at a time, then the newest: 200 quick moves ask a few times, and the last picture is the last move's.
async function refresh() {
  asked += 1;
  document.body.dataset.asked = asked;
  if (busy) { again = true; return; }
  busy = true;
  do {
    again = false;
    const mine = asked;
    try {
      const found = await (await post("answer", JSON.stringify(whole()))).json();
      if (mine > answered) { answered = mine; draw(found); get("error").hidden = true; }
    } catch (error) { answered = mine; wrong(error); }
    document.body.dataset.answered = answered;
  } while (again);
  busy = false;
}

function draw(found) {
  const x = found.x, heights = found.quantity === "height";
  chart(get("chart-profile"), {title: heights ? "Profile (um)" : "Friction of the texture", xlabel: "position (mm)",
    lines: [{x, y: found.profile, cls: "one"}], least: heights ? 1 : 0.02});
  chart(get("chart-friction"), {title: "Apparent friction", xlabel: "position (mm)", lost: found.lost,
    lines: [{x, y: found.friction, cls: "one", name: "wish"}, {x, y: found.felt, cls: "two", name: "display"}],
    band: found.band === null ? null : {y: found.friction, half: found.band}, least: 0.01});
  chart(get("chart-voltage"), {title: "Voltage (V, effective)", xlabel: "position (mm)",
    lines: [{x, y: found.voltage, cls: "one"}], least: 10});
  chart(get("chart-spectrum"), {title: "Spectrum of the friction", xlabel: "frequency (Hz)",
    lines: [{x: found.frequency.slice(0, 100), y: found.wish.slice(0, 100), cls: "one", name: "wish"},
      {x: found.frequency.slice(0, 100), y: found.given.slice(0, 100), cls: "two", name: "display"}], least: 1e-4});
  get("notes").replaceChildren(...found.notes.map((note) => {
    const item = document.createElement("li");
    item.textContent = note;
    return item;
  }));
  numbers(found);
  get("about").textContent = `${found.texture}; licence: ${found.licence}. ${found.provenance.join(" ")}`;
}

function numbers(found) {
  const n = found.numbers, percent = (v) => v === null ? "none" : v > 0 && v < 0.001 ? "below 0.1 %" : `${(100 * v).toFixed(v < 0.1 ? 1 : 0)} %`;
  const told = {
    "Voltage, rms": `${n.rms.toFixed(0)} V`, "Voltage, peak": `${n.peak.toFixed(0)} V`,
    "Voltage by": found.encoding, "Friction by": found.source,
    "Friction, mean": n.mean.toFixed(3), "Friction, highest less lowest": n.range.toFixed(4),
    "Friction, error of the estimate": found.band !== null ? `+- ${found.band.toFixed(4)}, nine of ten`
      : found.source === "estimate" ? "unknown" : "no estimate",
    "Slide that cannot be rendered": percent(n.lost), "Friction force, error on the display": percent(n.force_error),
    "Friction spectrum, error on the display": percent(n.spectrum_error),
  };
  for (const [low, high, error, share] of found.bands) {
    if (share > 0.01) told[`Spectrum, error ${low} to ${high} Hz`] = percent(error);
  }
  get("hint").textContent = `On this insulator strong_troxel attracts touching skin ${n.laws.toFixed(0)} times as hard as `
    + "kaczmarek; docs/howto/which-law.md says which to take.";
  get("numbers").replaceChildren(...Object.entries(told).map(([key, value]) => {
    const pair = document.createElement("div"), name = document.createElement("dt"), said = document.createElement("dd");
    name.textContent = key;
    said.textContent = value;
    pair.append(name, said);
    return pair;
  }));
}

// What the end of a run is called, and what it means.
const MESSAGES = {
  starting: "the model starts",
  done: "done: the friction is now the model's",
  cancelled: "cancelled: what was shown stays",
  ended: "the run broke off: what was shown stays",
  "without a result": "the model found no result: what was shown stays",
};

// -- the model ------------------------------------------------------------------------------------------------

async function run(encoding) {
  const now = state(), text = JSON.stringify(now), starter = document.activeElement;
  running = new AbortController();
  const mine = running;
  showRunning(true, "starting");
  if (starter.disabled) get("cancel").focus();
  let ended = "done";
  try {
    const answer = await post(`run?encoding=${encoding}`, text, mine.signal);
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    let rest = "";
    for (;;) {
      const {done, value} = await reader.read();
      if (done) break;
      const lines = (rest + value).split("\n");
      rest = lines.pop();
      for (const line of lines) ended = told(JSON.parse(line), now) || ended;
    }
  } catch (error) {
    ended = error.name === "AbortError" ? "cancelled" : "ended";
    if (error.name !== "AbortError") wrong(error);
  }
  const left = [get("cancel"), document.body].includes(document.activeElement);
  if (running === mine) showRunning(false, ended);
  if (left && !starter.disabled) starter.focus();
}

function told(line, now) {
  if (line.of) {
    get("progress").max = line.of;
    get("progress").value = line.step;
    get("said").textContent = `step ${line.step} of ${line.of}`;
  } else if (line.curve) {
    model = {key: felt(now), ...line.curve};
    get("said").textContent = "the slide is done";
    refresh();
  } else if (line.exact) {
    exact = {key: shown_by(now), ...line.exact};
    refresh();
  } else if (line.picture) {
    show("picture", "png", line.picture);
  } else if (line.animation) {
    show("animation", "gif", line.animation);
  } else if (line.error) {
    wrong(new Error(line.error));
    return "without a result";
  }
  return null;
}

function show(id, kind, data) {
  get(id).src = `data:image/${kind};base64,${data}`;
  get(id).hidden = false;
}

function showRunning(on, said) {
  get("run").disabled = get("exact").disabled = on;
  get("cancel").hidden = !on;
  get("progress").hidden = !on;
  if (on) get("progress").value = 0;
  get("said").textContent = MESSAGES[said] || said;
  document.body.dataset.run = on ? "running" : said;
}

// -- files, uploads, links --------------------------------------------------------------------------------------

async function save(kind) {
  try {
    const answer = await post(`file?kind=${kind}`, JSON.stringify(whole()));
    const name = /filename="(.*)"/.exec(answer.headers.get("Content-Disposition"))[1];
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await answer.blob());
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    get("said").textContent = `${name} saved`;
  } catch (error) { wrong(error); }
}

async function send() {
  const file = get("file").files[0];
  if (!file) return;
  const options = {name: file.name, mean: get("mean").value};
  for (const one of document.querySelectorAll("[data-import]")) options[one.dataset.import] = one.value;
  try {
    upload = await (await post(`upload?${new URLSearchParams(options)}`, file)).json();
    get("uploaded").textContent = `${upload.name}: ${upload.x.length} rows. ${upload.provenance.join(" ")}`;
    get("error").hidden = true;
    await refresh();
  } catch (error) { wrong(error); }
}

const FORM = ["reference", "generator", "frequency", "amplitude", "irregularity", "second", "phase", "period", "height",
  "ridged", "friction", "load", "speed", "length", "display", "law", "insulator", "roughness_gap", "voltage_max"];

function link() {
  const from = chosen(), all = {from};
  for (const id of FORM) all[id] = get(id).value;
  if (from === "draw") all.drawn = drawn.map((v) => Number(v.toFixed(3)));
  if (from === "upload") all.upload = upload;
  const bytes = new TextEncoder().encode(JSON.stringify(all));
  return btoa(Array.from(bytes, (b) => String.fromCharCode(b)).join(""));
}

// A link that was made elsewhere is only what the controls take; the server checks what they give.
function restore() {
  const text = location.hash.slice(1);
  if (!text) return;
  try {
    const all = JSON.parse(new TextDecoder().decode(Uint8Array.from(atob(text), (c) => c.charCodeAt(0))));
    for (const id of FORM) if (typeof all[id] === "string") get(id).value = all[id];
    if (Array.isArray(all.drawn) && all.drawn.length === DRAWN) {
      drawn = all.drawn.map((v) => Math.max(-1, Math.min(1, Number(v) || 0)));
    }
    if (all.upload) upload = all.upload;
    const radio = document.querySelector(`input[name=from][value="${CSS.escape(String(all.from))}"]`);
    if (radio) radio.checked = true;
  } catch { wrong(new Error("this link is damaged; the page begins anew")); }
}

// -- drawing -----------------------------------------------------------------------------------------------------

let place = 0;

function sketch() {
  const canvas = get("canvas"), pen = canvas.getContext("2d"), style = getComputedStyle(document.body);
  const {width, height} = canvas, at = (i) => [(i + 0.5) * width / DRAWN, height * (0.5 - 0.45 * drawn[i])];
  pen.clearRect(0, 0, width, height);
  pen.strokeStyle = style.getPropertyValue("--grid");
  pen.beginPath(); pen.moveTo(0, height / 2); pen.lineTo(width, height / 2); pen.stroke();
  pen.strokeStyle = style.getPropertyValue("--blue");
  pen.lineWidth = 3;
  pen.beginPath();
  drawn.forEach((_, i) => pen.lineTo(...at(i)));
  pen.stroke();
  pen.fillStyle = style.getPropertyValue("--vermilion");
  pen.beginPath(); pen.arc(...at(place), 5, 0, 7); pen.fill();
  canvas.setAttribute("aria-valuenow", Math.round(100 * drawn[place]));
}

function changed() { sketch(); store(); refresh(); }

let before = null;

function pen(event) {
  const box = get("canvas").getBoundingClientRect(), clip = (v, low, high) => Math.max(low, Math.min(high, v));
  const i = clip(Math.floor((event.clientX - box.left) / box.width * DRAWN), 0, DRAWN - 1);
  const v = clip((0.5 - (event.clientY - box.top) / box.height) / 0.45, -1, 1);
  const from = before || [i, v], steps = Math.max(Math.abs(i - from[0]), 1);
  for (let k = 0; k <= steps; k++) {
    const share = k / steps;
    drawn[Math.round(from[0] + share * (i - from[0]))] = from[1] + share * (v - from[1]);
  }
  before = [i, v];
  place = i;
  changed();
}

function keys(event) {
  const moves = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 0.05], ArrowDown: [0, -0.05]}[event.key];
  if (!moves) return;
  event.preventDefault();
  place = (place + moves[0] + DRAWN) % DRAWN;
  drawn[place] = Math.max(-1, Math.min(1, drawn[place] + moves[1]));
  if (moves[1]) changed(); else sketch();
}

// -- the controls ------------------------------------------------------------------------------------------------

function outputs() {
  for (const slider of document.querySelectorAll("input[type=range]")) {
    const said = slider.id === "voltage_max" && slider.value === slider.max ? "no limit"
      : `${Number(slider.value)} ${slider.dataset.unit || ""}`;
    slider.parentElement.querySelector("output").textContent = said;
    slider.setAttribute("aria-valuetext", said);
  }
  for (const part of document.querySelectorAll("[data-from]")) part.hidden = part.dataset.from !== chosen();
}

let storing = 0;
function store() {
  clearTimeout(storing);
  storing = setTimeout(() => history.replaceState(null, "", `#${link()}`), 150);
}

async function begin() {
  const library = await (await fetch("library")).json();
  get("reference").replaceChildren(...library.map(({name, about}) => new Option(`${name}: ${about}`, name)));
  get("reference").value = "weave";
  restore();
  outputs();
  sketch();
  get("left").addEventListener("input", (event) => {
    if (event.target.closest("[data-from=upload]")) return;
    outputs(); store(); refresh();
  });
  get("left").addEventListener("submit", (event) => event.preventDefault());
  document.querySelector("[data-from=upload]").addEventListener("change", async () => { await send(); store(); });
  get("canvas").addEventListener("pointerdown", (event) => {
    before = null;
    get("canvas").setPointerCapture(event.pointerId);
    pen(event);
  });
  get("canvas").addEventListener("pointermove", (event) => { if (event.buttons) pen(event); });
  get("canvas").addEventListener("keydown", keys);
  get("clear").addEventListener("click", () => { drawn = drawn.map(() => 0); changed(); });
  get("run").addEventListener("click", () => run("closed"));
  get("exact").addEventListener("click", () => run("exact"));
  get("cancel").addEventListener("click", () => running.abort());
  for (const button of document.querySelectorAll("[data-file]")) {
    button.addEventListener("click", () => save(button.dataset.file));
  }
  get("link").addEventListener("click", async () => {
    history.replaceState(null, "", `#${link()}`);
    try { await navigator.clipboard.writeText(location.href); get("said").textContent = "link copied"; }
    catch { get("said").textContent = "the link stands in the address bar"; }
  });
  addEventListener("hashchange", () => { restore(); outputs(); sketch(); refresh(); });
  await refresh();
  document.body.dataset.ready = "yes";
}

begin().catch(wrong);
