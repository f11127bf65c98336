"use strict";
(() => {
  const byId = (id) => document.getElementById(id);
  const data = JSON.parse(byId("viewer-data").textContent);
  const frames = data.frames;
  const [width, height] = data.size;
  const viewer = byId("viewer"), stage = byId("stage"), canvas = byId("canvas");
  const slider = byId("slider"), play = byId("play"), pointer = byId("pointer");
  const MAX_ZOOM = 64, MAX_IMAGES = 40, RATES = [1, 2, 5, 10, 15, 24, 25, 30, 50, 60];

  // Pictures: those shown last are kept, so that playing again is smooth
  const images = new Map();
  const COLOR = "";
  let channel = COLOR;
  const address = (index, name) => name === COLOR ? frames[index].source : (frames[index].pictures || {})[name];

  function load(index, name) {
    const source = address(index, name) || frames[index].source;
    let found = images.get(source);
    if (!found) {
      const image = new Image();
      image.alt = "";
      image.draggable = false;
      image.src = source;
      found = image.decode().then(() => image);
      found.catch(() => images.delete(source));
    }
    images.delete(source);
    images.set(source, found);
    if (images.size > MAX_IMAGES) images.delete(images.keys().next().value);
    return found;
  }

  // The current frame. Only the newest request is shown when pictures arrive late.
  let current = 0, requested = 0;
  async function show(index) {
    const request = ++requested;
    current = index;
    slider.value = String(index);
    const number = String(frames[index].number);
    byId("frame").textContent = `frame ${number}`;
    slider.setAttribute("aria-valuetext", `frame ${number}`);
    try {
      const image = await load(index, channel);
      if (request !== requested) return;
      canvas.replaceChildren(image);
      viewer.dataset.shown = number;
      viewer.dataset.channel = channel || "color";
      pointer.classList.remove("failed");
    } catch {
      if (request !== requested) return;
      canvas.replaceChildren();
      viewer.dataset.shown = "";
      pointer.classList.add("failed");
      pointer.textContent = `The picture of frame ${number} cannot be loaded.`;
      return;
    }
    pointAgain();
    if (timer !== null && frames.length > 1) load((index + 1) % frames.length, channel).catch(() => {});
  }

  // Playing
  let timer = null;
  let rate = data.rate;
  function stop() {
    clearInterval(timer);
    timer = null;
    label();
  }
  function start() {
    clearInterval(timer);
    timer = setInterval(() => {
      // A late picture delays the movie instead of being left out
      if (viewer.dataset.shown === String(frames[current].number)) show((current + 1) % frames.length);
    }, 1000 / rate);
    label();
  }
  function label() {
    play.textContent = timer === null ? "\u25b6" : "\u275a\u275a";
    play.setAttribute("aria-label", timer === null ? "Play" : "Pause");
    viewer.dataset.playing = String(timer !== null);
  }
  const toggle = () => timer === null ? start() : stop();
  function step(by) {
    stop();
    show(Math.min(Math.max(current + by, 0), frames.length - 1));
  }

  // Zoom and pan: scale, and the place of the picture on the stage in CSS pixels
  let scale = 1, left = 0, top = 0;
  const base = () => stage.clientWidth / width;
  function place() {
    const [w, h] = [stage.clientWidth, stage.clientHeight];
    left = Math.min(0, Math.max(left, w * (1 - scale)));
    top = Math.min(0, Math.max(top, h * (1 - scale)));
    canvas.style.transform = `translate(${left}px, ${top}px) scale(${scale})`;
    canvas.classList.toggle("pixels", base() * scale * devicePixelRatio >= 2);
    // Otherwise fingers scroll the page
    stage.style.touchAction = scale > 1 ? "none" : "pan-y";
    byId("zoom").textContent = `${Math.round(100 * base() * scale)} %`;
  }
  function zoom(factor, x = stage.clientWidth / 2, y = stage.clientHeight / 2) {
    const wanted = Math.min(Math.max(scale * factor, 1), MAX_ZOOM);
    left = x - (x - left) * (wanted / scale);
    top = y - (y - top) * (wanted / scale);
    scale = wanted;
    place();
  }
  function fit() {
    scale = 1;
    place();
  }
  const on = (event) => {
    const box = stage.getBoundingClientRect();
    return [event.clientX - box.left - stage.clientLeft, event.clientY - box.top - stage.clientTop];
  };
  stage.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    zoom(Math.exp(-event.deltaY / 300), ...on(event));
  }, { passive: false });
  const fingers = new Map();
  stage.addEventListener("pointerdown", (event) => {
    if (event.pointerType === "mouse" && event.button !== 0) return;
    fingers.set(event.pointerId, on(event));
    try { stage.setPointerCapture(event.pointerId); } catch { /* it has just been lifted */ }
  });
  stage.addEventListener("pointermove", (event) => {
    const now = on(event);
    const before = fingers.get(event.pointerId);
    if (before) {
      const other = [...fingers].find(([id]) => id !== event.pointerId);
      if (other) {
        const far = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);
        const middle = [(now[0] + other[1][0]) / 2, (now[1] + other[1][1]) / 2];
        zoom(far(now, other[1]) / Math.max(far(before, other[1]), 1), ...middle);
      } else if (scale > 1) {
        stage.classList.add("panning");
        left += now[0] - before[0];
        top += now[1] - before[1];
        place();
      }
      fingers.set(event.pointerId, now);
    }
    point(now);
  });
  for (const name of ["pointerup", "pointercancel"]) stage.addEventListener(name, (event) => {
    fingers.delete(event.pointerId);
    if (!fingers.size) stage.classList.remove("panning");
  });
  stage.addEventListener("dblclick", (event) => scale > 1 ? fit() : zoom(4, ...on(event)));
  stage.addEventListener("pointerleave", () => {
    pointed = null;
    pointAgain();
  });

  // What is under the pointer
  const tables = new Map();
  function table(index) {
    let found = tables.get(index);
    if (!found && frames[index].ids) {
      found = unpack(frames[index].ids);
      tables.set(index, found);
      if (tables.size > 4) tables.delete(tables.keys().next().value);
    }
    return found;
  }
  async function unpack(text) {
    const bytes = Uint8Array.from(atob(text), (digit) => digit.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const buffer = await new Response(stream).arrayBuffer();
    const view = new DataView(buffer);
    const [w, h, particles, columns, distance] = [0, 4, 8, 12, 16].map((at) => view.getUint32(at, true));
    const count = w * h, tables = 20 + 3 * count;
    return {
      // The sample of a pixel of the picture
      at(x, y) {
        if (x < 0 || y < 0 || x >= width || y >= height) return null;
        // The last samples stand for the rest of the picture
        const [column, row] = [Math.min(Math.floor(x / distance), w - 1), Math.min(Math.floor(y / distance), h - 1)];
        const i = 20 + row * w + column;
        const number = view.getUint8(i) | view.getUint8(i + count) << 8 | view.getUint8(i + 2 * count) << 16;
        if (number === 0) return null;
        const value = (c) => view.getFloat32(tables + 4 * (particles * (c + 1) + number - 1), true);
        return {
          id: view.getUint32(tables + 4 * (number - 1), true),
          values: Array.from({ length: columns }, (_, c) => value(c)),
        };
      },
    };
  }
  const HINT = frames.some((frame) => frame.ids) ? "Point at a particle for its id." : "";
  let pointed = null;
  function point(place) {
    pointed = place;
    pointAgain();
  }
  async function pointAgain() {
    if (pointer.classList.contains("failed")) return;
    const place = pointed;
    if (!place) {
      pointer.textContent = HINT;
      return;
    }
    const pixel = [(place[0] - left) / (scale * base()), (place[1] - top) / (scale * base())];
    const [x, y] = pixel.map(Math.floor);
    let text = `pixel ${x}, ${y}`;
    const index = current;
    if (frames[index].ids) {
      try {
        const found = (await table(index)).at(pixel[0], pixel[1]);
        text += found ? `: particle ${found.id}` : ": no particle";
        if (found) data.values.forEach((name, c) => { text += `, ${name} ${number(found.values[c])}`; });
      } catch {
        text += ": this browser cannot read the ids";
      }
    }
    if (place === pointed && index === current) pointer.textContent = text;
  }
  const number = (value) => Number.isFinite(value) ? String(Number(value.toPrecision(4))) : "unknown";

  // Controls
  document.addEventListener("keydown", (event) => {
    const target = event.target;
    const isControl = target instanceof Element && target.closest("select, a, summary, input:not(#slider)");
    const isButton = target instanceof Element && target.closest("button");
    if (isControl || event.ctrlKey || event.metaKey || event.altKey) return;
    if (isButton && (event.key === " " || event.key === "Enter")) return;
    const keys = {
      ArrowLeft: () => step(-1), ArrowRight: () => step(1), Home: () => step(-frames.length),
      End: () => step(frames.length), " ": toggle, "+": () => zoom(1.5), "=": () => zoom(1.5),
      "-": () => zoom(1 / 1.5), "0": fit,
    };
    if (!Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    keys[event.key]();
  });
  slider.max = String(frames.length - 1);
  slider.addEventListener("input", () => {
    stop();
    show(Number(slider.value));
  });
  play.addEventListener("click", toggle);
  byId("zoom-in").addEventListener("click", () => zoom(1.5));
  byId("zoom-out").addEventListener("click", () => zoom(1 / 1.5));
  byId("zoom-fit").addEventListener("click", fit);
  const option = (select, value, text) => select.append(new Option(text, value));
  const rates = [...new Set([...RATES, rate])].sort((a, b) => a - b);
  for (const value of rates) option(byId("rate"), String(value), `${value} fps`);
  byId("rate").value = String(rate);
  byId("rate").addEventListener("change", (event) => {
    rate = Number(event.target.value);
    if (timer !== null) start();
  });
  if (data.channels.length) {
    byId("channel-label").hidden = false;
    option(byId("channel"), COLOR, "color");
    for (const name of data.channels) option(byId("channel"), name, name);
    byId("channel").addEventListener("change", (event) => {
      channel = event.target.value;
      show(current);
    });
  }
  stage.style.aspectRatio = `${width} / ${height}`;
  new ResizeObserver(place).observe(stage);
  pointer.textContent = HINT;
  label();
  place();
  show(0);
})();
