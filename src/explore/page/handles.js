// Handles over the picture: elements that are dragged with the mouse and moved with arrow keys. What they move is in
// placed.js.
"use strict";

/// Elements by the keys of their handles.
const handles = new Map();

/// Width and height of the stage, and where the page of the picture is in it, in pixels of the window; null without a
/// picture.
function pageBox() {
  if (!state.facts) return null;
  const { size } = state.facts.layout;
  const { clientWidth, clientHeight } = $("stage");
  const scale = Math.min(clientWidth / size[0], clientHeight / size[1]);
  return { scale, at: [(clientWidth - size[0] * scale) / 2, (clientHeight - size[1] * scale) / 2] };
}

/// The area of the picture of the particles in the stage: its top left corner and its size.
function pictureBox() {
  const box = pageBox();
  if (!box) return null;
  const { at, size } = state.facts.layout.picture;
  return { at: box.at.map((x, i) => x + at[i] * box.scale), size: size.map((x) => x * box.scale) };
}

/// The view that the picture will have.
const viewNow = () => state.view || state.facts.view;

/// Whether places of points in the picture are known.
const isProjected = () =>
  Boolean(state.facts) && !state.facts.is_stereo && viewNow().projection !== "equirectangular";

/// The place of a point in the stage; null if it is behind the camera.
function project(point) {
  const { eye, look_at, up, fov, projection, height } = viewNow();
  const forward = unit(add(look_at, eye, -1));
  const right = unit(cross(forward, up));
  const above = cross(right, forward);
  const from = add(point, eye, -1);
  const depth = dot(from, forward);
  if (projection === "perspective" && depth <= 0) return null;
  const half = projection === "orthographic" ? height / 2 : depth * Math.tan((fov * Math.PI) / 360);
  // Pixels of the whole image, of those the picture shows a window
  const { of, window: { first, image } } = state.facts;
  const x = 0.5 * image[0] + (dot(from, right) / half) * 0.5 * image[1] - first[0];
  const y = 0.5 * image[1] - (dot(from, above) / half) * 0.5 * image[1] - first[1];
  const box = pictureBox();
  return [box.at[0] + (x / of[0]) * box.size[0], box.at[1] + (y / of[1]) * box.size[1]];
}

/// How far along `axis` from `point` the place `target` of the stage is; the nearest one if it is not on that line.
function along(point, axis, target, diagonal) {
  const step = 1e-3 * diagonal;
  let length = 0;
  for (let i = 0; i < 6; i += 1) {
    const here = project(add(point, axis, length));
    const there = project(add(point, axis, length + step));
    if (!here || !there) break;
    const pace = add(there, here, -1).map((x) => x / step);
    const square = pace[0] ** 2 + pace[1] ** 2;
    // A line to the viewer: its pixels say nothing
    if (square * diagonal ** 2 < 100) return ((here[1] - target[1]) / $("stage").clientHeight) * diagonal;
    const miss = add(target, here, -1);
    length += (miss[0] * pace[0] + miss[1] * pace[1]) / square;
    length = Math.max(-diagonal, Math.min(diagonal, length));
  }
  return length;
}

/// Shows these handles, and no others. Each has a `key`, a `name`, a `kind` (a class), a place `at` in the stage, a
/// `size` if it has one, `begin`, which returns what `drag` takes with the distance, and `press` for keys. Those that
/// are sliders have `values`.
function showHandles(wanted) {
  const layer = $("handles");
  for (const own of wanted) {
    if (!handles.has(own.key)) {
      const made = makeHandle();
      handles.set(own.key, made);
      layer.append(made);
    }
    updateHandle(handles.get(own.key), own);
  }
  const keys = new Set(wanted.map((own) => own.key));
  for (const [key, old] of [...handles]) {
    if (keys.has(key)) continue;
    // The keyboard stays in the picture
    if (document.activeElement === old) $("stage").focus();
    old.remove();
    handles.delete(key);
  }
}

function updateHandle(handle, own) {
  handle.own = own;
  handle.className = `handle ${own.kind}${handle.drag ? " dragged" : ""}`;
  handle.setAttribute("aria-label", own.name);
  handle.title = own.name;
  handle.setAttribute("role", own.values ? "slider" : "button");
  const { min, max, now, text } = own.values || {};
  for (const [name, value] of Object.entries({ valuemin: min, valuemax: max, valuenow: now, valuetext: text })) {
    if (value === undefined) handle.removeAttribute(`aria-${name}`);
    else handle.setAttribute(`aria-${name}`, value);
  }
  // One that is dragged is ahead of the picture
  if (handle.drag && own.size) return;
  placeHandle(handle, own.at);
}

function placeHandle(handle, at) {
  const { size } = handle.own;
  Object.assign(handle.style, {
    left: `${at[0]}px`, top: `${at[1]}px`, width: size ? `${size[0]}px` : "", height: size ? `${size[1]}px` : "",
  });
}

function makeHandle() {
  const handle = element("div", { tabindex: "0" });
  const moved = (event, isMoving) => {
    const { drag, own } = handle;
    const by = [event.clientX - drag.x, event.clientY - drag.y];
    if (own.size) placeHandle(handle, add(drag.at, by));
    own.drag(drag.start, by, { isMoving, isNew: !drag.hasMoved });
    drag.hasMoved = true;
  };
  handle.addEventListener("pointerdown", (event) => {
    event.stopPropagation();
    if (event.button !== 0) return;
    handle.focus();
    handle.setPointerCapture(event.pointerId);
    const { own } = handle;
    handle.drag = { x: event.clientX, y: event.clientY, at: own.at, start: own.begin(), hasMoved: false };
  });
  handle.addEventListener("pointermove", (event) => {
    event.stopPropagation();
    const { drag } = handle;
    if (!drag) return;
    const isFar = Math.hypot(event.clientX - drag.x, event.clientY - drag.y) > 3;
    if (drag.hasMoved || isFar) moved(event, true);
  });
  const end = (event) => {
    if (!handle.drag) return;
    if (handle.drag.hasMoved) moved(event, false);
    handle.drag = null;
    showPlaced();
  };
  handle.addEventListener("pointerup", end);
  handle.addEventListener("pointercancel", end);
  handle.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !handle.own.press(event)) return;
    event.preventDefault();
    event.stopPropagation();
  });
  return handle;
}

/// The direction of an arrow key as steps to the right and down; null for other keys.
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/// Lines over the picture: polygons of places in the stage.
function showLines(polygons) {
  const svg = $("lines");
  const drawn = (places, layer) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", "polygon");
    made.setAttribute("points", places.map((at) => at.map((x) => x.toFixed(1)).join(",")).join(" "));
    made.setAttribute("class", layer);
    return made;
  };
  // Wide light lines under thin dark ones, for pictures of any colour
  svg.replaceChildren(...["under", "over"].flatMap((layer) => polygons.map((places) => drawn(places, layer))));
}
