// Lists of tables as forms that are made from the schema: styles, lights, meshes, arrows and others.
"use strict";

/// Entries whose rarer settings are shown.
const unfolded = new Set();

/// The schema of entries of this type.
function schemaOfEntry(schema, entry) {
  const kinds = schema.items.oneOf;
  return kinds ? kinds.find((kind) => kind.properties.type.const === entry.type) || kinds[0] : schema.items;
}

/// The form of the list `key`: its entries, a button that adds one, and the list as JSON.
function addList(parent, key) {
  const schema = schemaOf(key);
  const name = titled(key.split(".").slice(-1)[0]);
  const kinds = (schema.items.oneOf || []).map((kind) => kind.properties.type.const);
  const kind = element("select", { "aria-label": `Type of the new entry of ${key}` },
    ...kinds.map((word) => element("option", { value: word }, word)));
  const add = element("button", { onclick: () => change(key, (list) => list.push(newEntry(schema, kind.value))) },
    `Add to ${key}`);
  const entries = element("div", { class: "entries" });
  const text = element("details", {}, element("summary", {}, "As JSON"));
  const about = element("p", { class: "small" }, schema.description || "");
  parent.append(element("section", { class: "list", "aria-label": name },
    element("h3", {}, name), about, entries,
    element("div", { class: "row" }, ...(kinds.length > 0 ? [kind] : []), add), text));
  addField(text, key);
  state.lists.push({ key, entries });
  showList({ key, entries });
}

/// Shows the entries of a list if they have changed.
function showList({ key, entries }) {
  const list = listOf(key);
  showRows(entries, list, () => {
    for (const own of [...state.fields.keys()]) {
      if (own.startsWith(`${key}.`) && /^\d/.test(own.slice(key.length + 1))) state.fields.delete(own);
    }
    return list.map((entry, i) => entryOf(key, list, i));
  });
}

function entryOf(key, list, i) {
  const entry = list[i];
  const { properties, required = [] } = schemaOfEntry(schemaOf(key), entry);
  const names = Object.keys(properties).filter((name) => name !== "type");
  const isShown = (name) => required.includes(name) || entry[name] !== undefined;
  const field = (name) => entryField({ key, i, name, schema: properties[name], value: entry[name] });
  const title = `${i + 1}. ${entry.type || entry.name || entry.where || entry.attribute || entry.path || ""}`;
  const more = element("details", {}, element("summary", {}, "More settings"),
    ...names.filter((name) => !isShown(name)).flatMap(field));
  const path = `${key}.${i}`;
  more.open = unfolded.has(path);
  more.addEventListener("toggle", () => (more.open ? unfolded.add(path) : unfolded.delete(path)));
  const button = (label, act, isOff) => {
    const made = element("button", { "aria-label": `${label} entry ${i + 1} of ${key}`, onclick: () => change(key, act) }, label);
    made.disabled = isOff;
    return made;
  };
  const swap = (a, b) => (all) => { [all[a], all[b]] = [all[b], all[a]]; };
  return element("div", { class: "entry", role: "group", "aria-label": `Entry ${i + 1} of ${key}` },
    element("div", { class: "row" }, element("strong", { class: "grow" }, title),
      button("Up", swap(i - 1, i), i === 0), button("Down", swap(i, i + 1), i === list.length - 1),
      button("Remove", (all) => all.splice(i, 1), false)),
    ...names.filter(isShown).flatMap(field), more);
}

/// The field of one setting of an entry, with the words of its list if it has some.
function entryField({ key, i, name, schema, value }) {
  const path = `${key}.${i}.${name}`;
  const { parts, field } = makeField({
    key: path, name, schema,
    set: (given) => change(key, (list) => {
      if (given === undefined) delete list[i][name];
      else list[i][name] = given;
    }),
  });
  field.isEntry = true;
  const { input, reset, isList, box } = field;
  if (isList) input.value = value === undefined ? "" : JSON.stringify(value);
  else {
    input.value = shown(value);
    input.placeholder = shown(schema.default);
  }
  box.classList.toggle("changed", value !== undefined);
  reset.hidden = value === undefined;
  if (name in NAMED && parts.length > 1) input.addEventListener("focus", () => completeNames(parts[0], NAMED[name]));
  state.fields.set(path, [field]);
  return parts;
}

/// Settings of entries with names of values, and what follows a name in them.
const NAMED = { attribute: "", color_by: "", where: " > " };

/// Offers the names of the values of particles.
async function completeNames(words, end) {
  if (state.names.length === 0) await takeNames();
  words.replaceChildren(...state.names.map((own) => element("option", { value: own + end })));
}

/// A new entry with values for what must be given.
function newEntry(schema, type) {
  const { properties, required = [] } = schemaOfEntry(schema, { type });
  const needed = required.filter((name) => name !== "type");
  const entry = type ? { type } : {};
  for (const name of needed) entry[name] = firstValue(name, properties[name]);
  return entry;
}

/// A value to begin with, for particles of this size.
function firstValue(name, schema) {
  const [low, high] = boundsNow();
  const diagonal = diagonalOf([low, high]);
  const middle = add(low, high).map((x) => x / 2);
  const up = state.facts ? unit(viewNow().axis) : [0, 0, 1];
  const rounds = (point) => point.map((x) => rounded(x, diagonal));
  const known = {
    position: () => rounds(add(middle, up, diagonal)), direction: () => up.map((x) => 0 - x),
    min: () => rounds(low), max: () => rounds(high), normal: () => "x", point: () => rounds(middle),
    radius: () => rounded(diagonal / 10, diagonal), width: () => rounded(diagonal / 2, diagonal),
    height: () => rounded(diagonal / 2, diagonal), scale: () => 0.05,
    attribute: () => (state.names.includes("velocity") ? "velocity" : state.names[0] || "velocity"),
    frame: () => state.frames[state.frame],
  };
  if (known[name]) return known[name]();
  return schema.type === "number" || schema.type === "integer" ? 1 : "";
}
