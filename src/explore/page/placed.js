// What is placed in the picture: overlays, clip planes and boxes, and suns. Each has a form and handles over the picture.
"use strict";

const CORNERS = ["auto", "top-left", "top-right", "bottom-left", "bottom-right"];
const SIDES_OF_PLANES = ["x", "-x", "y", "-y", "z", "-z"];
/// The default distance of overlays from their corner, and how near to it they snap.
const OFFSET = 0.04;
const SNAP = 0.025;

/// The list of a key, to be changed: what was chosen, or else that of the manifest that the page was opened with.
const listOf = (key) => structuredClone(state.chosen.get(key) || state.given[key] || []);

/// The settings with another list. An empty one replaces that of the manifest.
const withList = (key, list) => ({ [key]: list.length === 0 && !state.given[key] ? undefined : list });

function change(key, change, options) {
  const list = listOf(key);
  change(list);
  choose(withList(key, list), options);
}

/// The lists of tables in the values of all settings, whose keys are as `clip.0.normal`.
function listsOf(values) {
  const lists = {};
  for (const [key, value] of Object.entries(values)) {
    const [list, entry, name] = key.split(".");
    // Automatic values are those that are not given
    if (/^\d+$/.test(entry) && value !== "auto") ((lists[list] ||= [])[Number(entry)] ||= {})[name] = value;
  }
  return lists;
}

function choice(label, words, value, onchange) {
  const select = element("select", { "aria-label": label }, ...words.map((word) => element("option", { value: word }, word)));
  select.value = value;
  select.addEventListener("change", () => onchange(select.value));
  return select;
}

/// Replaces the rows of a list if what they show has changed. A control that is left at this moment is left first.
function showRows(box, content, rowsOf) {
  const text = JSON.stringify(content);
  if (box.content === text) return;
  box.content = text;
  setTimeout(() => {
    const controls = () => [...box.querySelectorAll("input, select, button")];
    const focused = controls().indexOf(document.activeElement);
    box.replaceChildren(...rowsOf());
    if (focused < 0) return;
    const all = controls();
    (all[Math.min(focused, all.length - 1)] || box.closest("details").querySelector("summary")).focus();
  });
}

/// Shows handles and lines where the objects are now.
function showPlaced() {
  if (!state.facts) return;
  const clips = $("clip-section").open && isProjected() ? listOf("clip") : [];
  const { lines, grips } = clipHandles(clips);
  showLines(lines);
  showHandles([...overlayHandles(), ...grips, ...sunHandles()]);
}

/// A value with as many digits as pixels of a scene of this size need.
const rounded = (value, diagonal) => {
  const step = 10 ** Math.floor(Math.log10(diagonal / 2000));
  return Number((Math.round(value / step) * step).toPrecision(9));
};

/// The bounds of the particles, with those that were clipped since the page was opened.
const boundsNow = () => state.bounds || [[0, 0, 0], [1, 1, 1]];

function takeBounds([low, high]) {
  const isClipped = listOf("clip").length > 0 && state.bounds;
  const [least, most] = isClipped ? state.bounds : [low, high];
  state.bounds = [low.map((x, i) => Math.min(x, least[i])), high.map((x, i) => Math.max(x, most[i]))];
}
const diagonalOf = ([low, high]) => length(add(high, low, -1)) || 1;

// --- Overlays

const showOverlays = () => showRows($("overlays"), [listOf("overlay"), state.legend], overlayRows);

/// All overlays of the picture: those that were chosen, then those of the legend.
const overlaysNow = () => [...listOf("overlay"), ...state.legend];

/// Takes the lists from the values of all settings, when so many overlays were chosen. Those of the legend follow them.
/// Without any change, the values are those of the manifest.
function takeLists(values, { chosen, isUnchanged }) {
  const lists = listsOf(values);
  state.legend = (lists.overlay || []).slice(chosen);
  if (isUnchanged) {
    // Overlays of the manifest are not told from those of the legend, and are changed like these
    const { clip, light, arrows, mesh } = lists;
    state.given = { clip, light, arrows, mesh };
  }
}

/// Changes overlay `entry`. A legend that is changed becomes one of the overlays that were chosen.
function changeOverlay(entry, change, options) {
  const list = entry < listOf("overlay").length ? listOf("overlay") : overlaysNow();
  Object.assign(list[entry], change);
  for (const key of Object.keys(list[entry])) if (list[entry][key] === undefined) delete list[entry][key];
  choose({ overlay: list }, options);
}

function removeOverlay(entry) {
  const chosen = listOf("overlay");
  if (entry < chosen.length) return change("overlay", (list) => list.splice(entry, 1));
  const rest = overlaysNow().filter((_, i) => i !== entry);
  return choose({ legend: false, overlay: rest.length === 0 ? undefined : rest });
}

function overlayRows() {
  const chosen = listOf("overlay").length;
  return overlaysNow().map((overlay, i) => element("div", { class: "row" },
    element("span", {}, titled(overlay.type) + (i < chosen ? "" : " (legend)")),
    ...(overlay.type === "text" ? [textOf(overlay, i)] : []),
    choice(`Corner of overlay ${i + 1}`, CORNERS, overlay.corner || "auto", (corner) =>
      changeOverlay(i, { corner: corner === "auto" ? undefined : corner, offset: undefined })),
    element("button", { "aria-label": `Remove overlay ${i + 1}`, onclick: () => removeOverlay(i) }, "Remove")));
}

function textOf(overlay, i) {
  const input = element("input", { value: overlay.text ?? "", placeholder: "time", "aria-label": `Text of overlay ${i + 1}` });
  input.addEventListener("change", () => changeOverlay(i, { text: input.value || undefined }));
  return input;
}

/// The corner and the offset of an overlay that is at this place of a picture, and snaps to corners.
function cornerAt(at, size, picture, snap = SNAP) {
  const inside = at.map((x, i) => Math.max(0, Math.min(picture[i] - size[i], x)));
  const isFar = inside.map((x, i) => x + size[i] / 2 > picture[i] / 2);
  const offset = inside.map((x, i) => {
    const pixels = isFar[i] ? picture[i] - size[i] - x : x;
    return Number((Math.max(0, pixels) / picture[1]).toFixed(3));
  });
  const corner = `${isFar[1] ? "bottom" : "top"}-${isFar[0] ? "right" : "left"}`;
  const isAtCorner = offset.every((part) => Math.abs(part - OFFSET) <= snap);
  return { corner, offset: isAtCorner ? undefined : offset };
}

/// Where an overlay that is dropped at this place of the page goes.
function dropped({ at, size, is_beside }) {
  const { picture, size: page } = state.facts.layout;
  const from = add(at, picture.at, -1);
  const middle = from.map((x, i) => x + size[i] / 2);
  const isOver = middle.every((x, i) => x > 0 && x < picture.size[i]);
  if (isOver || !is_beside) {
    return { ...cornerAt(from, size, picture.size), layout: is_beside ? "over" : undefined };
  }
  return { corner: cornerAt(at, size, page).corner, offset: undefined };
}

function overlayHandles() {
  const box = pageBox();
  const all = overlaysNow();
  return state.facts.layout.overlays.filter(({ entry }) => all[entry]).map((area) => {
    const { entry, at, size, is_beside } = area;
    const own = all[entry];
    const drop = (change, options) => changeOverlay(entry, { ...change, layout: change.layout ?? own.layout }, options);
    return {
      key: `overlay ${entry}`, kind: "overlay", name: `${titled(own.type)}; drag it, or move it with arrow keys`,
      at: at.map((x, i) => box.at[i] + x * box.scale), size: size.map((x) => x * box.scale),
      begin: () => ({ area, scale: box.scale }),
      drag: (start, by, how) => {
        // One beside the picture moves when it is dropped, as the picture then has another size
        if (is_beside && how.isMoving) return;
        const moved = start.area.at.map((x, i) => x + by[i] / start.scale);
        drop(dropped({ ...start.area, at: moved }), is_beside ? {} : how);
      },
      press: ({ key, shiftKey }) => {
        const step = ARROWS[key];
        if (!step) return false;
        drop(stepped(own, area, step.map((x) => x * (shiftKey ? 0.05 : 0.01))));
        return true;
      },
    };
  });
}

/// The place of an overlay after a step, as parts of the height of the picture. Beside the picture, it goes to the
/// next corner.
function stepped(overlay, area, [right, down]) {
  const { picture } = state.facts.layout;
  const from = add(area.at, picture.at, -1);
  const seen = cornerAt(from, area.size, picture.size, 0);
  const own = overlay.corner ? overlay : seen;
  const [vertical, horizontal] = own.corner.split("-");
  if (area.is_beside) {
    const across = right === 0 ? horizontal : right > 0 ? "right" : "left";
    const upright = down === 0 ? vertical : down > 0 ? "bottom" : "top";
    return { corner: `${upright}-${across}`, offset: undefined };
  }
  const most = picture.size.map((side, i) => (side - area.size[i]) / picture.size[1]);
  const by = [horizontal === "left" ? right : -right, vertical === "top" ? down : -down];
  const offset = (own.offset || [OFFSET, OFFSET]).map((x, i) => Number(Math.max(0, Math.min(most[i], x + by[i])).toFixed(3)));
  return { corner: own.corner, offset };
}

// --- Clip planes and boxes

/// Changes the clips. An automatic camera stays where it is, as it would else follow what is left of the particles.
function changeClips(change, options) {
  const list = listOf("clip");
  change(list);
  const isFollowing = setting("camera.mode") === "auto" && state.view;
  choose({ ...(isFollowing ? cameraOf(state.view) : {}), ...withList("clip", list) }, options);
}

const axisOf = (i) => [0, 1, 2].map((own) => Number(own === i));

/// The unit normal of a plane.
function normalOf({ normal }) {
  if (Array.isArray(normal)) return unit(normal);
  const sign = normal.startsWith("-") ? -1 : 1;
  return axisOf("xyz".indexOf(normal.slice(-1))).map((x) => sign * x);
}

/// The normal of a plane, and where it is along it: the offset from the origin is `base + offset`.
function planeOf(clip) {
  const normal = normalOf(clip);
  return { normal, base: dot(normal, clip.point || [0, 0, 0]), offset: clip.offset || 0 };
}

const cornersOf = (bounds) => [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((axis) => bounds[(i >> axis) & 1][axis]));

/// The offsets of a plane at which it passes all of the particles.
function rangeOf(clip, bounds) {
  const { normal, base } = planeOf(clip);
  const all = cornersOf(bounds).map((corner) => dot(corner, normal) - base);
  return [Math.min(...all), Math.max(...all)];
}

/// The points where a plane meets the edges of a box, around their middle.
function crossSection({ normal, base, offset }, bounds) {
  const corners = cornersOf(bounds);
  const points = [];
  corners.forEach((a, i) => {
    for (const axis of [1, 2, 4]) {
      const b = corners[i ^ axis];
      if (i & axis) continue;
      const [from, to] = [a, b].map((corner) => dot(corner, normal) - base - offset);
      if (from * to < 0) points.push(add(a, add(b, a, -1), from / (from - to)));
    }
  });
  if (points.length < 3) return [];
  const middle = points.reduce((sum, point) => add(sum, point, 1 / points.length), [0, 0, 0]);
  const first = unit(add(points[0], middle, -1));
  const second = cross(normal, first);
  const angle = (point) => Math.atan2(dot(add(point, middle, -1), second), dot(add(point, middle, -1), first));
  return points.sort((a, b) => angle(a) - angle(b));
}

/// Where points are in the stage; no line if one is behind the camera.
function lineOf(points) {
  const places = points.map(project);
  return places.length > 1 && places.every(Boolean) ? [places] : [];
}

function clipHandles(clips) {
  const bounds = boundsNow();
  const parts = clips.map((clip, i) => (clip.type === "box" ? boxHandles(clip, i, bounds) : planeHandles(clip, i, bounds)));
  return { lines: parts.flatMap((part) => part.lines), grips: parts.flatMap((part) => part.grips) };
}

function planeHandles(clip, i, bounds) {
  const plane = planeOf(clip);
  const [low, high] = bounds;
  const middle = add(low, high).map((x) => x / 2);
  const points = crossSection(plane, bounds);
  const anchor = add(middle, plane.normal, plane.base + plane.offset - dot(middle, plane.normal));
  const [min, max] = rangeOf(clip, bounds);
  return {
    lines: lineOf(points),
    grips: clipGrip({
      key: `plane ${i}`, name: `Plane ${i + 1}`, point: anchor, axis: plane.normal, value: plane.offset, min, max, bounds,
      set: (offset, how) => changeClips((list) => { list[i].offset = offset; }, how),
    }),
  };
}

function boxHandles(clip, i, bounds) {
  const middle = add(clip.min, clip.max).map((x) => x / 2);
  const faces = [0, 1, 2].flatMap((axis) => ["min", "max"].map((end) => ({ axis, end })));
  const grips = faces.flatMap(({ axis, end }) => {
    const point = [...middle];
    point[axis] = clip[end][axis];
    // The faces of a box do not pass each other
    const [min, max] = end === "min" ? [bounds[0][axis], clip.max[axis]] : [clip.min[axis], bounds[1][axis]];
    return clipGrip({
      key: `box ${i} ${end} ${axis}`, name: `Box ${i + 1}, ${end} ${"xyz"[axis]}`, point, axis: axisOf(axis),
      value: clip[end][axis], min, max, bounds,
      set: (value, how) => changeClips((list) => {
        const other = list[i][end === "min" ? "max" : "min"][axis];
        list[i][end][axis] = end === "min" ? Math.min(value, other) : Math.max(value, other);
      }, how),
    });
  });
  const corners = cornersOf([clip.min, clip.max]);
  const quad = (a, b, c, d) => lineOf([corners[a], corners[b], corners[c], corners[d]]);
  return { lines: [...quad(0, 1, 3, 2), ...quad(4, 5, 7, 6), ...quad(0, 1, 5, 4), ...quad(2, 3, 7, 6)], grips };
}

/// The handle of one value that moves `point` along `axis`; none if it is not in the stage.
function clipGrip({ key, name, point, axis, value, min, max, bounds, set }) {
  const at = project(point);
  const { clientWidth, clientHeight } = $("stage");
  if (!at || at[0] < 0 || at[1] < 0 || at[0] > clientWidth || at[1] > clientHeight) return [];
  const diagonal = diagonalOf(bounds);
  const to = (by) => rounded(value + by, diagonal);
  return [{
    key, kind: "clip", name: `${name}; drag it, or move it with arrow keys`, at,
    values: { min, max, now: value, text: String(Number(value.toPrecision(5))) },
    begin: () => ({ at, point, axis, value }),
    drag: (start, by, how) => {
      const moved = along(start.point, start.axis, add(start.at, by), diagonal);
      set(rounded(start.value + moved, diagonal), how);
    },
    press: ({ key: pressed, shiftKey }) => {
      const sign = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[pressed];
      if (!sign) return false;
      set(to((sign * (max - min || diagonal) * (shiftKey ? 10 : 1)) / 100));
      return true;
    },
  }];
}

function showClips() {
  showRows($("clips"), [listOf("clip"), boundsNow()], () =>
    listOf("clip").map((clip, i) => (clip.type === "box" ? boxRow(clip, i) : planeRow(clip, i))));
}

const clipEnd = (clip, i, name) => [
  choice(`Kind of ${name}`, ["particles", "cut"], clip.mode || "particles", (mode) => changeClips((list) => { list[i].mode = mode; })),
  element("button", { "aria-label": `Remove ${name}`, onclick: () => changeClips((list) => list.splice(i, 1)) }, "Remove"),
];

function planeRow(clip, i) {
  const bounds = boundsNow();
  const [low, high] = rangeOf(clip, bounds);
  const slider = element("input", {
    type: "range", min: low, max: high, step: (high - low) / 200 || 1, value: clip.offset || 0,
    "aria-label": `Place of plane ${i + 1}`,
  });
  slider.value = clip.offset || 0;
  let isNew = true;
  const slide = (isMoving) => {
    const offset = rounded(Number(slider.value), diagonalOf(bounds));
    changeClips((list) => { list[i].offset = offset; }, { isMoving, isNew });
    isNew = !isMoving;
  };
  slider.addEventListener("input", () => slide(true));
  slider.addEventListener("change", () => slide(false));
  const named = shown(clip.normal);
  const sides = SIDES_OF_PLANES.includes(named) ? SIDES_OF_PLANES : [named, ...SIDES_OF_PLANES];
  return element("div", { class: "row" },
    choice(`Side of plane ${i + 1}`, sides, named, (normal) => {
      if (normal === named) return;
      const [from, to] = rangeOf({ ...clip, normal }, bounds);
      changeClips((list) => Object.assign(list[i], { normal, offset: rounded((from + to) / 2, diagonalOf(bounds)) }));
    }),
    element("label", { class: "grow" }, slider), ...clipEnd(clip, i, `plane ${i + 1}`));
}

function boxRow(clip, i) {
  const bounds = boundsNow();
  const number = (end, axis) => {
    const input = element("input", {
      type: "number", step: rounded(diagonalOf(bounds) / 100, diagonalOf(bounds)), value: clip[end][axis],
      "aria-label": `Box ${i + 1}, ${end} ${"xyz"[axis]}`,
    });
    input.addEventListener("change", () => changeClips((list) => { list[i][end][axis] = Number(input.value); }));
    return input;
  };
  return element("div", { class: "box" },
    element("div", { class: "row" },
      choice(`Side of box ${i + 1} that is kept`, ["inside", "outside"], clip.keep || "inside",
        (keep) => changeClips((list) => { list[i].keep = keep; })),
      ...clipEnd(clip, i, `box ${i + 1}`)),
    ...["min", "max"].map((end) => element("div", { class: "triple" }, end, ...[0, 1, 2].map((axis) => number(end, axis)))));
}

function addPlane() {
  const bounds = boundsNow();
  const offset = rounded(0.5 * (bounds[0][0] + bounds[1][0]), diagonalOf(bounds));
  changeClips((list) => list.push({ type: "plane", normal: "x", offset, mode: "particles" }));
}

/// Adds a box around the middle half of the particles.
function addBox() {
  const [low, high] = boundsNow();
  const at = (part) => low.map((x, i) => rounded(x + part * (high[i] - x), diagonalOf([low, high])));
  changeClips((list) => list.push({ type: "box", min: at(0.25), max: at(0.75) }));
}

// --- Suns

const radians = (degrees) => (degrees * Math.PI) / 180;
const degrees = (angle) => (angle * 180) / Math.PI;
const turnOf = (angle) => ((angle % 360) + 360) % 360;

/// Directions to the right of the view, to the viewer and up, as the program has them for skies.
function skyAxes() {
  const { eye, look_at, up, axis } = viewNow();
  const above = unit(axis);
  const forward = add(look_at, eye, -1);
  const isSteep = length(cross(forward, above)) < 1e-3 * length(forward);
  const level = isSteep ? up : forward;
  const ahead = unit(add(level, above, -dot(level, above)));
  return { right: cross(ahead, above), back: ahead.map((x) => -x), above };
}

const setting = (key) => state.chosen.get(key) ?? state.values[key];

/// The suns on the dial: that of the sky, and those among the lights. `azimuth` is that on the dial.
function sunsNow() {
  if (!state.facts) return [];
  const suns = [];
  const sky = setting("environment.sun");
  if (setting("environment.type") === "sky" && sky) {
    const rotation = setting("environment.rotation") || 0;
    suns.push({
      key: "sun of the sky", name: "Sun of the sky", elevation: sky.elevation, azimuth: turnOf(sky.azimuth - rotation),
      lowest: -12, // a dusk
      set: ({ elevation, azimuth }, how) =>
        choose({ "environment.sun": { ...sky, elevation, azimuth: turnOf(azimuth + rotation) } }, how),
    });
  }
  const { right, back, above } = skyAxes();
  listOf("light").forEach((light, i) => {
    if (!["sun", "directional"].includes(light.type) || !Array.isArray(light.direction)) return;
    const to = unit(light.direction).map((x) => -x);
    const azimuth = turnOf(degrees(Math.atan2(dot(to, back), dot(to, right))));
    const elevation = degrees(Math.asin(Math.max(-1, Math.min(1, dot(to, above)))));
    suns.push({
      key: `sun ${i}`, name: `Light ${i + 1}`, elevation, azimuth, lowest: 0,
      set: (own, how) => change("light", (list) => { list[i].direction = directionOf(own, { right, back, above }); }, how),
    });
  });
  return suns;
}

/// The direction of light from a sun there.
function directionOf({ elevation, azimuth }, { right, back, above }) {
  const level = Math.cos(radians(elevation));
  const parts = [level * Math.cos(radians(azimuth)), level * Math.sin(radians(azimuth)), Math.sin(radians(elevation))];
  const to = [0, 1, 2].map((i) => parts[0] * right[i] + parts[1] * back[i] + parts[2] * above[i]);
  return to.map((x) => Number((-x).toFixed(4)) + 0);
}

/// Handles on the dial, which shows the sky from above: the middle is above the particles, the viewer below.
function sunHandles() {
  const dial = $("dial");
  const suns = $("light-section").open ? sunsNow() : [];
  dial.hidden = suns.length === 0;
  if (dial.hidden) return [];
  const radius = dial.clientWidth / 2;
  const middle = [dial.offsetLeft + dial.clientLeft + radius, dial.offsetTop + dial.clientTop + radius];
  return suns.map(({ key, name, elevation, azimuth, lowest, set }) => {
    const out = (radius * (90 - elevation)) / 90; // a sun below the horizon is outside of the dial
    const at = [middle[0] + out * Math.cos(radians(azimuth)), middle[1] + out * Math.sin(radians(azimuth))];
    const text = `elevation ${Math.round(elevation)} degrees, azimuth ${Math.round(azimuth)} degrees`;
    return {
      key, kind: "sun", name: `${name}, ${text}; drag it, or turn it with arrow keys`, at,
      values: { min: lowest, max: 90, now: Math.round(elevation), text },
      begin: () => at,
      drag: (start, by, how) => set(sunAt(add(add(start, by), middle, -1), radius, lowest), how),
      press: ({ key: pressed, shiftKey }) => {
        const step = ARROWS[pressed];
        if (!step) return false;
        const [by, down] = step.map((x) => x * (shiftKey ? 1 : 5));
        set({ elevation: Math.round(Math.max(lowest, Math.min(90, elevation - down))), azimuth: turnOf(Math.round(azimuth + by)) });
        return true;
      },
    };
  });
}

/// The sun at a place of the dial, relative to its middle; `lowest` is its least elevation.
const sunAt = ([x, y], radius, lowest) => ({
  elevation: Math.round(Math.max(lowest, 90 * (1 - Math.hypot(x, y) / radius))),
  azimuth: Math.round(turnOf(degrees(Math.atan2(y, x)))) % 360,
});

/// The form of the sun of a sky.
function showSun() {
  $("sun").hidden = setting("environment.type") !== "sky";
  const own = setting("environment.sun");
  if (own && !$("sun").contains(document.activeElement)) {
    $("elevation").value = own.elevation;
    $("azimuth").value = own.azimuth;
  }
}

function addSun() {
  const direction = directionOf({ elevation: 45, azimuth: 40 }, skyAxes());
  change("light", (list) => list.push({ type: "sun", direction, intensity: 3 }));
}

function listenToPlaced() {
  $("clip-add").addEventListener("click", addPlane);
  $("box-add").addEventListener("click", addBox);
  $("sun-add").addEventListener("click", addSun);
  for (const button of document.querySelectorAll("[data-overlay]")) {
    button.addEventListener("click", () => {
      const type = button.dataset.overlay;
      change("overlay", (list) => list.push({ type, ...(type === "text" && { text: "{time}" }) }));
    });
  }
  let isNew = true;
  const sun = (isMoving) => {
    const own = { elevation: Number($("elevation").value), azimuth: Number($("azimuth").value) };
    choose({ "environment.sun": { ...setting("environment.sun"), ...own } }, { isMoving, isNew });
    isNew = !isMoving;
  };
  for (const id of ["elevation", "azimuth"]) {
    $(id).addEventListener("input", () => sun(true));
    $(id).addEventListener("change", () => sun(false));
  }
  for (const id of ["clip-section", "light-section"]) $(id).addEventListener("toggle", showPlaced);
  new ResizeObserver(showPlaced).observe($("stage"));
}
