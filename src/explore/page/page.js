// The page of `spherule explore`. What was chosen is a map from keys of the manifest to values; the camera is among
// them. The program answers each wish with pictures that become finer. All text from the data is set as text.
"use strict";

const $ = (id) => document.getElementById(id);
const PAGE = crypto.getRandomValues(new Uint32Array(1))[0];
/// Views from the sides, as offsets to the eye in the axes right, forward, up.
const SIDES = {
  front: [0, -1, 0], back: [0, 1, 0], left: [-1, 0, 0], right: [1, 0, 0],
  top: [0, -1e-4, 1], bottom: [0, -1e-4, -1], iso: [-0.61, -0.61, 0.5],
};

const state = {
  frames: [], schema: null, fields: new Map(), lists: [], names: [], histogram: null,
  chosen: new Map(), past: [], future: [],
  frame: 0, view: null, facts: null, values: {}, blob: null, number: 0,
  isMoving: false, wishes: 0, isSending: false, isWished: false, isAtRest: false,
  legend: [], given: {}, bounds: null, clicked: [], picks: 0, playing: 0, hasParticles: false,
};
// For tests: the last picture and what belongs to it
window.explore = state;

// --- Vectors

const add = (a, b, s = 1) => a.map((x, i) => x + s * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const length = (a) => Math.hypot(...a);
const unit = (a) => a.map((x) => x / (length(a) || 1));
/// `v` turned around the unit vector `axis` by `angle` radians.
const turned = (v, axis, angle) => {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const around = cross(axis, v);
  return v.map((x, i) => x * c + around[i] * s + axis[i] * dot(axis, v) * (1 - c));
};
/// Numbers as short as pictures need them.
const short = (v) => v.map((x) => Number(x.toPrecision(9)));

// --- Requests

async function ask(path, body) {
  const options = body === undefined ? {} : { method: "POST", body: JSON.stringify(body) };
  const answer = await fetch(path, options);
  if (answer.ok) return answer.status === 204 ? null : answer.json();
  if (answer.status !== 422) throw new Error(await answer.text());
  throw (await answer.json()).fault;
}

const settings = () => [...state.chosen].map(([key, value]) => ({ key, value }));
const wait = (ms) => new Promise((done) => setTimeout(done, ms));

/// Sends the newest wish, one at a time.
async function wish() {
  state.isWished = true;
  if (state.isSending) return;
  state.isSending = true;
  while (state.isWished) {
    state.isWished = false;
    const frame = state.frames[state.frame];
    const own = { frame, settings: settings(), is_moving: state.isMoving };
    try {
      state.wishes = (await ask("wish", { page: PAGE, wish: own })).wish;
      state.isAtRest = !state.isMoving;
    } catch (error) {
      showFault(error);
      await wait(500);
      state.isWished = !(error && error.key !== undefined);
    }
  }
  state.isSending = false;
}

/// Shows pictures as they come, for ever.
async function showPictures() {
  let pause = 250;
  for (;;) {
    try {
      const answer = await fetch(`picture?page=${PAGE}&after=${state.number}`);
      if (!answer.ok) throw new Error(await answer.text());
      pause = 250;
      if ($("lost").hidden === false) {
        $("lost").hidden = true;
        wish();
      }
      if (answer.status === 204) continue;
      const header = answer.headers.get("X-Picture");
      if (header === null) {
        const failed = await answer.json();
        state.number = failed.number;
        $("busy").hidden = true;
        showFault(failed.fault);
        continue;
      }
      const about = JSON.parse(header);
      const blob = await answer.blob();
      state.number = about.number;
      showPicture(about, blob);
    } catch (error) {
      $("lost").hidden = false;
      await wait(pause);
      pause = Math.min(2 * pause, 5000);
    }
  }
}

function showPicture({ wish: number, facts }, blob) {
  const picture = $("picture");
  const old = picture.src;
  picture.src = URL.createObjectURL(blob);
  if (old) URL.revokeObjectURL(old);
  picture.alt = `Frame ${facts.frame}, ${facts.particles} particles`;
  $("busy").hidden = true;
  state.blob = blob;
  state.facts = facts;
  takeBounds(facts.bounds);
  state.shown = number;
  // While the mouse moves, the view here is ahead of the picture
  if (!state.isMoving && number >= state.wishes) {
    state.view = facts.view;
    if (facts.is_last && state.histogram) drawHistogram();
    clearFault();
    if (state.isAtRest) takeValues(number);
  } else if (!state.view) {
    state.view = facts.view;
  }
  const [width, height] = facts.size;
  const time = facts.time === null ? "" : `, time ${Number(facts.time.toPrecision(6))}`;
  const isWhole = facts.every === 1;
  const how = facts.is_last ? (isWhole ? "as rendered" : "a draft") : `${facts.samples} of ${facts.of_samples} samples`;
  $("draft").hidden = isWhole;
  $("draft").textContent = isWhole ? "" : `Draft: 1 of ${facts.every} particles. Not all of them fit into the memory limit.`;
  $("status").textContent =
    `${facts.particles.toLocaleString("en")} particles${time}, ${width} x ${height}, ${how}, ${facts.milliseconds} ms`;
  const list = $("notes").querySelector("ul");
  list.replaceChildren(...facts.notes.map((note) => element("li", {}, note)));
  $("notes").hidden = facts.notes.length === 0;
  $("notes").querySelector("summary").textContent = `Notes (${facts.notes.length})`;
  showPlaced();
}

// --- What was chosen

/// Changes what was chosen: `changes` maps keys to values, or to undefined for their defaults.
function choose(changes, { isMoving = false, isNew = true } = {}) {
  if (isNew) {
    state.past.push(new Map(state.chosen));
    if (state.past.length > 500) state.past.shift();
    state.future = [];
  }
  for (const [key, value] of Object.entries(changes)) {
    state.chosen.delete(key);
    if (value !== undefined) state.chosen.set(key, value);
  }
  state.isMoving = isMoving;
  if (isMoving) showPlaced();
  else showChosen();
  wish();
}

function goTo(from, to) {
  if (from.length === 0) return;
  to.push(new Map(state.chosen));
  state.chosen = from.pop();
  state.isMoving = false;
  state.view = null;
  showChosen();
  wish();
}
const undo = () => goTo(state.past, state.future);
const redo = () => goTo(state.future, state.past);

function showChosen() {
  $("undo").disabled = state.past.length === 0;
  $("redo").disabled = state.future.length === 0;
  const keys = [...state.chosen.keys()];
  $("changed").textContent = keys.length === 0 ? "nothing" : keys.join(", ");
  for (const [key, fields] of state.fields) for (const field of fields) showField(key, field);
  showClips();
  showOverlays();
  state.lists.forEach(showList);
  showSun();
  showPlaced();
  showKeys();
}

let valuesOf = 0;
/// Takes the values of all settings, as the program sees them.
async function takeValues(number) {
  if (valuesOf === number) return;
  valuesOf = number;
  try {
    const isUnchanged = state.chosen.size === 0;
    const chosen = listOf("overlay").length;
    state.values = await ask("values", { settings: settings() });
    takeLists(state.values, { chosen, isUnchanged });
    showChosen();
    showColor();
  } catch (error) {
    showFault(error);
  }
}

function showFault(fault) {
  const text = fault.message || String(fault);
  const fields = state.fields.get(fault.key) || [];
  for (const { why, input } of fields) {
    why.textContent = text;
    why.hidden = false;
    input.setAttribute("aria-invalid", "true");
  }
  $("fault").textContent = text;
  $("fault").hidden = false;
}

function clearFault() {
  $("fault").hidden = true;
  for (const fields of state.fields.values()) {
    for (const { why, input } of fields) {
      why.hidden = true;
      input.removeAttribute("aria-invalid");
    }
  }
}

// --- Camera

/// The settings of a camera with this view.
function cameraOf(view) {
  const keys = {
    "camera.mode": "fixed", "camera.eye": short(view.eye), "camera.look_at": short(view.look_at),
    "camera.up": short(unit(view.up)), "camera.projection": view.projection,
  };
  // Defaults of a fixed camera are others
  if (view.projection === "perspective") keys["camera.fov"] = view.fov;
  if (view.projection === "orthographic") keys["camera.height"] = Number(view.height.toPrecision(9));
  return keys;
}

/// Moves the camera; the first move of a gesture can be undone.
function move(change, { isNew = true, isMoving = false } = {}) {
  if (!state.view) return;
  const view = structuredClone(state.view);
  change(view);
  state.view = view;
  choose(cameraOf(view), { isMoving, isNew });
}

function orbit(view, right, up) {
  const axis = unit(view.axis);
  let offset = add(view.eye, view.look_at, -1);
  offset = turned(offset, axis, -right);
  view.up = turned(view.up, axis, -right);
  const side = unit(cross(offset, view.up));
  // Up to the pole, at which the view has no side
  const angle = Math.acos(Math.max(-1, Math.min(1, dot(unit(offset), axis))));
  const by = Math.max(angle - Math.PI + 0.01, Math.min(angle - 0.01, up));
  const lifted = turned(offset, side, by);
  const isRolled = Math.abs(dot(unit(cross(offset, axis)), view.up)) > 1e-6;
  view.up = isRolled ? turned(view.up, side, by) : axis;
  view.eye = add(view.look_at, lifted);
}

/// Moves eye and target by these parts of the height of the picture.
function pan(view, right, up) {
  const offset = add(view.eye, view.look_at, -1);
  const side = unit(cross(view.up, offset));
  const above = unit(cross(offset, side));
  const height = view.projection === "orthographic"
    ? view.height : 2 * length(offset) * Math.tan((view.fov * Math.PI) / 360);
  const by = add(side.map((x) => x * right * height), above, up * height);
  view.eye = add(view.eye, by);
  view.look_at = add(view.look_at, by);
}

function zoom(view, factor) {
  if (view.projection === "orthographic") view.height *= factor;
  const offset = add(view.eye, view.look_at, -1);
  view.eye = add(view.look_at, offset.map((x) => x * factor));
}

function roll(view, angle) {
  const forward = unit(add(view.look_at, view.eye, -1));
  view.up = turned(view.up, forward, angle);
}

function showSide(name) {
  state.view = null;
  choose({
    "camera.mode": undefined, "camera.eye": undefined, "camera.look_at": undefined, "camera.up": undefined,
    "camera.height": undefined, "camera.fov": undefined, "camera.key": undefined, "camera.view": name,
  });
}

function fit() {
  state.view = null;
  choose(Object.fromEntries(["mode", "eye", "look_at", "up", "height", "fov", "view", "key"].map((k) => [`camera.${k}`, undefined])));
}

/// The place of an event in the picture, as fractions; null outside.
function placeOf(event) {
  const box = pictureBox();
  if (!box) return null;
  const stage = $("stage").getBoundingClientRect();
  const x = (event.clientX - stage.left - box.at[0]) / box.size[0];
  const y = (event.clientY - stage.top - box.at[1]) / box.size[1];
  return x >= 0 && x < 1 && y >= 0 && y < 1 ? [x, y] : null;
}

const under = ([x, y], values) =>
  ask(`particle?page=${PAGE}&x=${x}&y=${y}${values ? "&values=1" : ""}`);

async function centre(place) {
  const found = place && (await under(place, false));
  if (found) {
    move((view) => {
      const by = add(found.point, view.look_at, -1);
      view.eye = add(view.eye, by);
      view.look_at = found.point;
    });
  }
}

async function showParticle(place) {
  if (!place) return;
  try {
    const found = await under(place, true);
    const list = $("particle");
    list.replaceChildren();
    if (!found) {
      $("distance").textContent = "";
      state.clicked = [];
      return;
    }
    state.hasParticles = true;
    const say = (name, value) => list.append(element("dt", {}, name), element("dd", {}, value));
    const number = (x) => (x === null ? "not finite" : String(Number(x.toPrecision(7))));
    list.closest("details").open = true;
    const { values, point } = found;
    if (values) {
      const names = new Map(values.names);
      say("id", String(values.id));
      say("position", values.position.map(number).join(", "));
      for (const [name, numbers] of values.attributes) {
        const known = names.has(name) ? `${names.get(name)} (${number(numbers[0])})` : numbers.map(number).join(", ");
        say(name, known);
      }
    } else {
      say("id", String(found.id));
    }
    state.clicked = [...state.clicked.slice(-1), values ? values.position : point];
    const [a, b] = state.clicked;
    $("distance").textContent = b ? `Distance from the particle before: ${number(length(add(a, b, -1)))}` : "";
  } catch (error) {
    showFault(error);
  } finally {
    state.picks += 1;
  }
}

// --- Mouse, touch and keys in the picture

function listenToStage() {
  const stage = $("stage");
  const fingers = new Map();
  let drag = null;
  stage.addEventListener("pointerdown", (event) => {
    stage.focus();
    stage.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const isPan = event.button !== 0 || event.shiftKey;
    drag = { x: event.clientX, y: event.clientY, isPan, hasMoved: false, spread: spread() };
    stage.classList.add("dragging");
  });
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  };
  stage.addEventListener("pointermove", (event) => {
    if (!drag) return hover(event);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const [dx, dy] = [event.clientX - drag.x, event.clientY - drag.y];
    if (!drag.hasMoved && Math.hypot(dx, dy) < 4) return;
    const how = { isNew: !drag.hasMoved, isMoving: true };
    const height = stage.clientHeight;
    if (fingers.size > 1) {
      const now = spread();
      move((view) => zoom(view, (drag.spread || now) / now), how);
      drag.spread = now;
    } else if (drag.isPan) {
      move((view) => pan(view, -dx / height, dy / height), how);
    } else {
      move((view) => orbit(view, (dx / height) * Math.PI, (dy / height) * Math.PI), how);
    }
    Object.assign(drag, { x: event.clientX, y: event.clientY, hasMoved: true });
  });
  const end = (event) => {
    fingers.delete(event.pointerId);
    if (!drag || fingers.size > 0) return;
    if (drag.hasMoved) rest();
    else if (event.type === "pointerup") showParticle(placeOf(event));
    drag = null;
    stage.classList.remove("dragging");
  };
  stage.addEventListener("pointerup", end);
  stage.addEventListener("pointercancel", end);
  stage.addEventListener("contextmenu", (event) => event.preventDefault());
  stage.addEventListener("dblclick", (event) => centre(placeOf(event)));
  let wheel = 0;
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    move((view) => zoom(view, Math.exp(event.deltaY * 0.001)), { isNew: wheel === 0, isMoving: true });
    clearTimeout(wheel);
    wheel = setTimeout(() => { wheel = 0; rest(); }, 200);
  }, { passive: false });
  stage.addEventListener("keydown", pressed);
}

/// The mouse has stopped: the picture becomes finer.
function rest() {
  state.isMoving = false;
  showChosen();
  wish();
}

let hovered = 0;
async function hover(event) {
  const now = performance.now();
  const place = placeOf(event);
  if (now - hovered < 120 || !place || !state.facts) return;
  hovered = now;
  try {
    const found = await under(place, state.hasParticles);
    const by = colorName();
    const own = found && found.values && found.values.attributes.find(([name]) => name === by);
    const size = own && Math.hypot(...own[1].map((x) => x ?? NaN));
    const value = size === undefined || size === null || !own ? "" : `, ${by} ${Number(size.toPrecision(5))}`;
    $("stage").title = found ? `particle ${found.id}${value}` : "";
  } catch { /* The next one may be answered */ }
}

const step = (5 * Math.PI) / 180;
const KEYS = {
  ArrowLeft: (v) => orbit(v, -step, 0), ArrowRight: (v) => orbit(v, step, 0),
  ArrowUp: (v) => orbit(v, 0, step), ArrowDown: (v) => orbit(v, 0, -step),
  "+": (v) => zoom(v, 1 / 1.1), "=": (v) => zoom(v, 1 / 1.1), "-": (v) => zoom(v, 1.1),
  "[": (v) => roll(v, -step), "]": (v) => roll(v, step),
};
const PANS = { ArrowLeft: [-0.05, 0], ArrowRight: [0.05, 0], ArrowUp: [0, 0.05], ArrowDown: [0, -0.05] };

function pressed(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const { key } = event;
  const sides = Object.keys(SIDES);
  if (event.shiftKey && PANS[key]) move((view) => pan(view, ...PANS[key]));
  else if (KEYS[key]) move(KEYS[key]);
  else if (key >= "1" && key <= "7") showSide(sides[Number(key) - 1]);
  else if (key === "f") fit();
  else if (key === "c") centre([0.5, 0.5]);
  else if (key === "Enter") showParticle([0.5, 0.5]);
  else if (key === "u") undo();
  else if (key === "r") redo();
  else if (key === " ") play();
  else if (key === ",") showFrame(state.frame - 1);
  else if (key === ".") showFrame(state.frame + 1);
  else if (key === "?") $("help").showModal();
  else return;
  event.preventDefault();
}

// --- Frames

function showFrame(index, isMoving = false) {
  const frame = Math.max(0, Math.min(state.frames.length - 1, index));
  state.frame = frame;
  state.hasParticles = false;
  $("frame").value = frame;
  $("frame-number").textContent = state.frames[frame];
  state.isMoving = isMoving;
  wish();
}

async function play() {
  state.playing += 1;
  const own = state.playing;
  const isOn = $("play").getAttribute("aria-pressed") !== "true";
  $("play").setAttribute("aria-pressed", String(isOn));
  while (isOn && state.playing === own) {
    const next = (state.frame + 1) % state.frames.length;
    showFrame(next, true);
    const until = performance.now() + 5000;
    // The next frame follows when this one is there
    while (state.playing === own && performance.now() < until
      && (!state.facts || state.facts.frame !== state.frames[next])) await wait(15);
    await wait(30);
  }
  if (!isOn) rest();
}

// --- Forms

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
    else if (value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/// The schema of a dotted key.
function schemaOf(key) {
  let node = state.schema;
  for (const part of key.split(".")) node = node && node.properties && node.properties[part];
  return node;
}

/// The words that a schema allows.
function wordsOf(schema) {
  if (schema.const !== undefined) return [schema.const];
  if (schema.enum) return schema.enum;
  if (schema.type === "boolean") return [true, false];
  const kinds = schema.anyOf || [];
  return kinds.flatMap((kind) => (kind.properties || kind.$ref ? [] : wordsOf(kind)));
}

const isOnlyWords = (schema) =>
  schema.enum !== undefined || schema.type === "boolean"
  || (schema.anyOf !== undefined && schema.anyOf.every((k) => k.const !== undefined || isOnlyWords(k)));

const shown = (value) => {
  if (value === undefined || value === null) return "";
  return typeof value === "string" ? value : JSON.stringify(value);
};

/// What a user typed, as a value: JSON if it is, else text.
function typed(text) {
  const trimmed = text.trim();
  if (trimmed === "") return undefined;
  try { return JSON.parse(trimmed); } catch { return trimmed; }
}

/// Whether a key is a list of tables, which is written as JSON.
const isTables = (schema) => schema.type === "array" && Boolean(schema.items?.properties || schema.items?.oneOf);

/// Examples of such lists.
const EXAMPLES = {
  style: '[{ "where": "type == 2", "draw": "sticks", "color": [0.8, 0.1, 0.1] }]',
  light: '[{ "type": "sun", "direction": [1, -2, -3], "intensity": 2 }]',
  mesh: '[{ "path": "tank.stl", "material": "glass" }]',
  arrows: '[{ "attribute": "velocity", "scale": 0.05 }]',
};

/// Why a text is no JSON.
function reason(text) {
  try { return String(JSON.parse(text)); } catch (error) { return error.message; }
}

/// A name as a label.
const titled = (name) => (name[0].toUpperCase() + name.slice(1)).replaceAll("_", " ");

let fieldCount = 0;

/// The control of a value with this schema, and the list of its words if it has one beside it.
function makeControl(schema, id, example) {
  const isList = isOnlyWords(schema);
  const name = isList ? "select" : isTables(schema) ? "textarea" : "input";
  const input = element(name, { id, spellcheck: "false" });
  if (isTables(schema)) {
    Object.assign(input, { rows: 3, placeholder: example || "[{ }]" });
  } else if (isList) {
    input.append(element("option", { value: "" }, "default"));
    for (const word of wordsOf(schema)) input.append(element("option", { value: JSON.stringify(word) }, String(word)));
  } else if (schema.type === "number" || schema.type === "integer") {
    Object.assign(input, { type: "number", step: schema.type === "integer" ? "1" : "any" });
    if (schema.minimum !== undefined) input.min = schema.minimum;
    if (schema.maximum !== undefined) input.max = schema.maximum;
  } else {
    const words = wordsOf(schema);
    const list = element("datalist", { id: `${id}-words` }, ...words.map((w) => element("option", { value: String(w) })));
    input.setAttribute("list", list.id);
    return { input, isList, words: [list] };
  }
  return { input, isList, words: [] };
}

/// A field of the setting `key` that calls `set` with its value, or with undefined for the default: what belongs into the
/// page, and the field.
function makeField({ key, name, schema, set }) {
  fieldCount += 1;
  const id = `field-${fieldCount}`;
  const label = element("label", { for: id, title: key }, titled(name));
  const about = element("div", { class: "about", hidden: "" }, `${key}: ${schema.description || ""}`);
  label.addEventListener("click", () => { about.hidden = !about.hidden; });
  const { input, isList, words } = makeControl(schema, id, EXAMPLES[key]);
  input.setAttribute("aria-description", `${key}: ${schema.description || ""}`);
  const why = element("div", { class: "why", role: "alert", hidden: "" });
  const reset = element("button", { class: "reset", title: "Back to the default", "aria-label": `Default of ${key}`, hidden: "" }, "reset");
  const box = element("div", { class: "field" }, label, input, reset, about, why);
  input.addEventListener("change", () => {
    const value = isList ? (input.value === "" ? undefined : JSON.parse(input.value)) : typed(input.value);
    // A list that is no JSON would be refused as a text; say where it is wrong
    if (isTables(schema) && typeof value === "string") return showFault({ key, message: `${key}: ${reason(value)}` });
    return set(value);
  });
  reset.addEventListener("click", () => set(undefined));
  return { parts: [...words, box], field: { box, input, reset, why, isList } };
}

function addField(parent, key) {
  const schema = schemaOf(key);
  if (!schema) return;
  const name = key.split(".").slice(-1)[0];
  const { parts, field } = makeField({ key, name, schema, set: (value) => choose({ [key]: value }) });
  state.fields.set(key, [...(state.fields.get(key) || []), field]);
  parent.append(...parts);
  showField(key, field);
}

/// Adds the form of a key: a field, or one for each entry of a list.
function addForm(parent, key) {
  const schema = schemaOf(key);
  if (schema && isTables(schema)) addList(parent, key);
  else addField(parent, key);
}

function showField(key, { box, input, reset, isList, isEntry }) {
  // Fields of entries are made again when their list changes
  if (isEntry) return;
  const isChanged = state.chosen.has(key);
  const value = isChanged ? state.chosen.get(key) : state.values[key];
  box.classList.toggle("changed", isChanged);
  reset.hidden = !isChanged;
  if (document.activeElement === input && !isList) return;
  if (isList) input.value = value === undefined ? "" : JSON.stringify(value);
  else if (isChanged) input.value = shown(value);
  else {
    input.value = input.type === "number" ? shown(value) : "";
    input.placeholder = shown(value) || input.placeholder;
  }
}

function makeForms() {
  for (const place of document.querySelectorAll("[data-keys]")) {
    for (const key of place.dataset.keys.split(" ")) addForm(place, key);
  }
  // All keys, by section
  for (const [section, node] of Object.entries(state.schema.properties)) {
    const keys = node.properties ? Object.keys(node.properties).map((key) => `${section}.${key}`) : [section];
    const own = keys.filter((key) => schemaOf(key));
    const box = element("details", { "data-section": section }, element("summary", {}, section));
    box.addEventListener("toggle", () => {
      if (box.open && box.childElementCount === 1) own.forEach((key) => addForm(box, key));
    });
    $("all").append(box);
  }
  $("search").addEventListener("input", () => {
    const word = $("search").value.trim().toLowerCase().replaceAll(" ", "_");
    for (const box of $("all").children) {
      const section = box.dataset.section;
      const node = state.schema.properties[section];
      const keys = Object.entries(node.properties || { [section]: node });
      const fits = ([key, own]) => `${section}.${key} ${own.description || ""}`.toLowerCase().includes(word);
      box.hidden = word !== "" && !keys.some(fits);
      box.open = word.length > 2 && !box.hidden;
      for (const field of box.querySelectorAll(".field")) {
        field.hidden = word !== "" && !field.querySelector(".about").textContent.toLowerCase().includes(word);
      }
    }
  });
}

// --- Colour

/// The table of the colour, with what was chosen.
function colorTable() {
  const own = state.chosen.get("material.color") ?? state.values["material.color"];
  return own && typeof own === "object" && !Array.isArray(own) ? { ...own } : {};
}
const colorName = () => colorTable().attribute || "";

function changeColor(change, options) {
  const table = { ...colorTable(), ...change };
  for (const key of Object.keys(table)) if (table[key] === undefined) delete table[key];
  choose({ "material.color": table }, options);
}

async function takeNames() {
  try {
    state.names = await ask(`names?frame=${state.frames[state.frame]}`);
    state.hasParticles = true;
    // Conditions are completed with them
    for (const { input } of state.fields.get("select.where") || []) {
      input.list?.replaceChildren(...state.names.map((own) => element("option", { value: `${own} > ` })));
    }
  } catch (error) {
    showFault(error);
  }
  showColor();
}

async function showColor() {
  const select = $("color-by");
  const name = colorName();
  const plain = ["auto", "elements"];
  const all = [...plain, ...new Set([...state.names, ...(name ? [name] : [])])];
  if (select.childElementCount !== all.length) {
    select.replaceChildren(...all.map((own) => element("option", { value: own }, own)));
  }
  const given = state.chosen.get("material.color");
  select.value = name || (typeof given === "string" ? given : "auto");
  const map = colorTable().map;
  const known = wordsOf(schemaOfMap());
  if ($("color-map").childElementCount === 0) {
    $("color-map").append(element("option", { value: "" }, "default"), ...known.map((own) => element("option", { value: own }, own)));
  }
  $("color-map").value = known.includes(map) ? map : "";
  $("color-map").disabled = name === "";
  await showHistogram(name);
}

function schemaOfMap() {
  const find = (node) => {
    if (!node || typeof node !== "object") return null;
    if (node.properties && node.properties.map && node.properties.attribute) return node.properties.map;
    for (const child of [...(node.anyOf || []), ...(node.oneOf || [])]) {
      const found = find(child);
      if (found) return found;
    }
    return null;
  };
  return find(schemaOf("material.color")) || {};
}

async function showHistogram(name) {
  const box = $("histogram");
  const isNumeric = name !== "" && !colorTable().values;
  box.hidden = !isNumeric || state.names.length === 0;
  if (box.hidden) return;
  const key = `${name} ${state.frames[state.frame]}`;
  if (!state.histogram || state.histogram.key !== key) {
    try {
      state.histogram = { key, ...(await ask(`histogram?frame=${state.frames[state.frame]}&name=${encodeURIComponent(name)}`)) };
    } catch {
      box.hidden = true;
      return;
    }
  }
  drawHistogram();
}

/// The range that was chosen, or that of the picture.
function colorRange() {
  const { range } = colorTable();
  if (Array.isArray(range) && range.length === 2) return range;
  return (state.facts && state.facts.range) || state.histogram.range;
}

function drawHistogram() {
  const { counts, range: [low, high] } = state.histogram;
  const most = Math.max(...counts, 1);
  const [from, to] = colorRange();
  const at = (i) => low + ((i + 0.5) / counts.length) * (high - low);
  const svg = $("histogram").querySelector("svg");
  svg.replaceChildren(...counts.map((count, i) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", "rect");
    // Square roots, so that rare values can be seen
    const tall = 62 * Math.sqrt(count / most);
    const place = { x: (i * 256) / counts.length, width: 256 / counts.length - 0.5, y: 64 - tall, height: tall };
    for (const [key, value] of Object.entries(place)) made.setAttribute(key, value);
    if (at(i) < from || at(i) > to) made.setAttribute("class", "out");
    return made;
  }));
  const place = (value) => Math.round((1000 * (value - low)) / (high - low || 1));
  for (const [id, value] of [["low", from], ["high", to]]) {
    if (document.activeElement !== $(id)) $(id).value = Number(value.toPrecision(5));
    if (document.activeElement !== $(`${id}-drag`)) $(`${id}-drag`).value = place(value);
  }
}

function listenToColor() {
  const once = () => { if (state.names.length === 0) takeNames(); };
  $("color-by").addEventListener("focus", once);
  for (const { input } of state.fields.get("select.where") || []) input.addEventListener("focus", once);
  $("color-by").addEventListener("change", () => {
    const name = $("color-by").value;
    state.histogram = null;
    if (name === "auto") return choose({ "material.color": undefined });
    if (name === "elements") return choose({ "material.color": name });
    const { map } = colorTable();
    return choose({ "material.color": { attribute: name, ...(map && { map }) } });
  });
  $("color-map").addEventListener("change", () => changeColor({ map: $("color-map").value || undefined }));
  const typedRange = () => {
    const range = [Number($("low").value), Number($("high").value)];
    changeColor({ range });
  };
  for (const id of ["low", "high"]) {
    $(id).addEventListener("change", typedRange);
    let isNew = true;
    const drag = (isMoving) => {
      const { range: [low, high] } = state.histogram;
      const range = [...colorRange()];
      const index = id === "low" ? 0 : 1;
      range[index] = Number((low + ($(`${id}-drag`).value / 1000) * (high - low)).toPrecision(5));
      if (range[0] < range[1]) changeColor({ range }, { isMoving, isNew });
      isNew = !isMoving;
      drawHistogram();
    };
    $(`${id}-drag`).addEventListener("input", () => drag(true));
    $(`${id}-drag`).addEventListener("change", () => drag(false));
  }
}

// --- Keys of the camera

function showKeys() {
  const keys = state.chosen.get("camera.key") || [];
  const mode = state.chosen.get("camera.mode");
  $("keys").textContent = mode === "turntable" ? "The camera goes around."
    : keys.length === 0 ? "" : `The camera moves through frames ${keys.map((key) => key.frame).join(", ")}.`;
}

function addKey() {
  if (!state.view) return;
  const { eye, look_at, up } = state.view;
  const frame = state.frames[state.frame];
  const own = { frame, eye: short(eye), look_at: short(look_at), up: short(unit(up)) };
  const others = (state.chosen.get("camera.key") || []).filter((key) => key.frame !== frame);
  const keys = [...others, own].sort((a, b) => a.frame - b.frame);
  const gone = Object.fromEntries(["eye", "look_at", "up", "view"].map((key) => [`camera.${key}`, undefined]));
  choose({ ...gone, "camera.key": keys, "camera.mode": keys.length > 1 ? "keys" : "fixed", ...(keys.length > 1 ? {} : cameraOf(state.view)) });
}

function turntable() {
  const degrees = Number((360 / Math.max(1, state.frames.length)).toPrecision(6));
  const gone = Object.fromEntries(["eye", "look_at", "up", "height", "key"].map((key) => [`camera.${key}`, undefined]));
  state.view = null;
  choose({ ...gone, "camera.mode": "turntable", "camera.degrees_per_frame": state.frames.length > 1 ? degrees : undefined });
}

// --- Saving

async function save(path, body, say) {
  try {
    const made = await ask(path, { settings: settings(), frame: state.frames[state.frame], ...body });
    $("saved").textContent = say(made);
    clearFault();
    return made;
  } catch (error) {
    $("saved").textContent = "";
    showFault(error);
    return null;
  }
}

async function copyCommand() {
  const made = await save("manifest", {}, () => "Copied");
  if (!made) return;
  const box = $("command");
  box.hidden = false;
  box.value = made.command;
  box.select();
  try { await navigator.clipboard.writeText(made.command); } catch { $("saved").textContent = "The command is below"; }
}

async function renderAll() {
  if (!(await save("render", { name: $("name").value }, (made) => `Started ${made.path}`))) return;
  const bar = $("progress");
  bar.hidden = false;
  for (let quiet = 0; quiet < 20;) {
    await wait(1000);
    const now = await save("progress", {}, (made) => made
      ? `${made.done} of ${made.frames} frames in ${made.directory}${made.failed ? `, ${made.failed} failed` : ""}` : "Starting");
    if (now) {
      Object.assign(bar, { max: now.frames, value: now.done });
      if (now.done + now.failed >= now.frames) return;
    }
    quiet = now && now.is_running ? 0 : quiet + 1;
  }
  $("saved").textContent += "; no process works on it: its log is beside the manifest";
}

function listenToButtons() {
  $("undo").addEventListener("click", undo);
  $("redo").addEventListener("click", redo);
  $("help-open").addEventListener("click", () => $("help").showModal());
  $("play").addEventListener("click", play);
  $("frame").addEventListener("input", () => showFrame(Number($("frame").value), true));
  $("frame").addEventListener("change", () => showFrame(Number($("frame").value)));
  $("fit").addEventListener("click", fit);
  for (const button of document.querySelectorAll("[data-side]")) {
    button.addEventListener("click", () => showSide(button.dataset.side));
  }
  $("key-add").addEventListener("click", addKey);
  $("turntable").addEventListener("click", turntable);
  $("keys-clear").addEventListener("click", () => {
    if (state.view) choose({ "camera.key": undefined, "camera.degrees_per_frame": undefined, ...cameraOf(state.view) });
  });
  $("save").addEventListener("click", () => save("save", { name: $("name").value }, (made) => `Saved ${made.path}`));
  $("copy").addEventListener("click", copyCommand);
  $("save-picture").addEventListener("click", () => {
    $("saved").textContent = "Rendering the picture";
    save("save-picture", { name: $("picture-name").value }, (made) => `Saved ${made.path}`);
  });
  $("render").addEventListener("click", renderAll);
}

async function begin() {
  $("busy").hidden = false;
  const { title, frames, schema } = await ask("start");
  Object.assign(state, { frames, schema });
  document.title = `${title} - spherule explore`;
  $("title").textContent = title;
  $("frame").max = frames.length - 1;
  $("frames").hidden = frames.length < 2;
  makeForms();
  listenToStage();
  listenToButtons();
  listenToColor();
  listenToPlaced();
  showChosen();
  // A simulation's first frame is rarely typical
  showFrame(Math.floor(frames.length / 2));
  showPictures();
}

begin().catch((error) => {
  $("busy").hidden = true;
  showFault(error);
});
