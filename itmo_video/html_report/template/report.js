"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const screen = byId("screen"), context = screen.getContext("2d");
  const frameInput = byId("frame"), exposure = byId("exposure"), split = byId("split");
  const mapBox = byId("map");
  // Light by 11-bit code; black is code 0.
  const light = new Float32Array(data.codes + 1);
  for (let c = 1; c <= data.codes; c++)
    light[c] = 2 ** ((c - 1) / (data.codes - 1) * (data.highest - data.lowest) + data.lowest);
  const ramp = Uint8Array.from(atob(data.ramp), (c) => c.charCodeAt(0));  // RGB of 256 levels
  const cache = new Map();
  let now = null, cursor = null, turn = 0;

  async function pixels(uri) {
    const image = new Image();
    image.src = uri;
    await image.decode();
    const canvas = document.createElement("canvas");
    canvas.width = image.naturalWidth;
    canvas.height = image.naturalHeight;
    const c = canvas.getContext("2d", { willReadFrequently: true });
    c.drawImage(image, 0, 0);
    return c.getImageData(0, 0, canvas.width, canvas.height);
  }

  async function load(i) {
    if (cache.has(i)) return cache.get(i);
    const frame = data.frames[i], [width, height] = frame.size, n = width * height;
    const both = (await pixels(frame.hdr)).data;
    const codes = new Uint16Array(3 * n);
    for (let p = 0; p < n; p++)
      for (let k = 0; k < 3; k++)
        codes[3 * p + k] = both[4 * p + k] << 3 | both[4 * (p + n) + k] >> 5;
    const loaded = { number: frame.number, index: frame.index, width, height, codes,
      source: frame.source ? (await pixels(frame.source)).data : null,
      map: frame.map ? await pixels(frame.map) : null };
    if (cache.size > 5) cache.delete(cache.keys().next().value);
    cache.set(i, loaded);
    return loaded;
  }

  const luminance = (f, p) => 0.2126 * light[f.codes[3 * p]] + 0.7152 * light[f.codes[3 * p + 1]] + 0.0722 * light[f.codes[3 * p + 2]];
  const view = () => document.querySelector("input[name=view]:checked").value;

  function draw() {
    if (!now) return;
    const { width, height, codes, source, map } = now;
    if (screen.width !== width || screen.height !== height) {
      screen.width = width; screen.height = height;
      screen.style.aspectRatio = `${width * data.aspect} / ${height}`;
    }
    const out = context.createImageData(width, height), o = out.data;
    const gain = 2 ** Number(exposure.value), isFalse = view() === "false";
    const table = new Uint8ClampedArray(data.codes + 1);
    for (let c = 0; c <= data.codes; c++) table[c] = 255 * Math.min(1, light[c] * gain) ** (1 / 2.4) + 0.5;
    const until = split && source ? Math.round(width * Number(split.value) / 100) : 0;
    for (let y = 0, p = 0; y < height; y++) for (let x = 0; x < width; x++, p++) {
      let r, g, b;
      if (x < until) {
        r = source[4 * p]; g = source[4 * p + 1]; b = source[4 * p + 2];
      } else if (isFalse) {
        const stop = Math.log2(Math.max(luminance(now, p), 1e-6));
        const level = (Math.floor(stop * 2) / 2 - data.falseLow) / (data.falseHigh - data.falseLow);
        const at = 3 * Math.round(255 * Math.min(1, Math.max(0, level)));
        r = ramp[at]; g = ramp[at + 1]; b = ramp[at + 2];
      } else {
        r = table[codes[3 * p]]; g = table[codes[3 * p + 1]]; b = table[codes[3 * p + 2]];
      }
      if (map && mapBox && mapBox.checked && x >= until) {
        const mx = Math.min(map.width - 1, Math.floor(x * map.width / width));
        const my = Math.min(map.height - 1, Math.floor(y * map.height / height));
        const m = map.data[4 * (my * map.width + mx)] / 255 * 0.75;
        r += m * (86 - r); g += m * (180 - g); b += m * (233 - b);
      }
      o[4 * p] = r; o[4 * p + 1] = g; o[4 * p + 2] = b; o[4 * p + 3] = 255;
    }
    context.putImageData(out, 0, 0);
    if (until > 0 && until < width) { context.fillStyle = "#fff"; context.fillRect(until - 0.5, 0, 1, height); }
    if (cursor) {
      context.strokeStyle = "#000"; context.lineWidth = 3; cross();
      context.strokeStyle = "#fff"; context.lineWidth = 1; cross();
    }
    byId("legend").hidden = !isFalse;
    tell();
  }

  function cross() {
    const { x, y } = cursor;
    context.strokeRect(x - 4.5, y - 4.5, 10, 10);
  }

  const short = (v) => v >= 100 ? v.toFixed(0) : v.toPrecision(3);

  function tell() {
    byId("frame-told").textContent = String(now.number);
    byId("exposure-told").textContent = `${Number(exposure.value).toFixed(1)} stops`;
    if (split) byId("split-told").textContent = `${split.value} %`;
    frameInput.setAttribute("aria-valuetext", `frame ${now.number}`);
    for (const line of document.querySelectorAll("svg .now")) {
      const x = data.left + data.positions[Number(frameInput.value)] * data.across;
      line.setAttribute("x1", x); line.setAttribute("x2", x);
    }
    if (!cursor) return;
    const p = cursor.y * now.width + cursor.x, y = luminance(now, p), nits = y * data.white;
    const rgb = [0, 1, 2].map((k) => light[now.codes[3 * p + k]]);
    const stops = y > 0 ? `${Math.log2(y) >= 0 ? "+" : ""}${Math.log2(y).toFixed(2)} stops` : "black";
    const told = byId("read-out");
    told.dataset.nits = nits;
    told.dataset.x = cursor.x; told.dataset.y = cursor.y;
    told.textContent = `(${cursor.x}, ${cursor.y}): ${short(nits)} nits, ${stops} about SDR white; ` +
      `R ${short(rgb[0])}, G ${short(rgb[1])}, B ${short(rgb[2])}`;
  }

  async function show() {
    const mine = ++turn, loaded = await load(Number(frameInput.value));
    if (mine !== turn) return;  // a later frame was asked for meanwhile
    now = loaded;
    if (cursor) cursor = { x: Math.min(cursor.x, now.width - 1), y: Math.min(cursor.y, now.height - 1) };
    draw();
    screen.dataset.frame = now.number;
  }

  frameInput.addEventListener("input", show);
  for (const input of document.querySelectorAll("#exposure, #split, input[name=view], #map"))
    input.addEventListener("input", draw);
  screen.addEventListener("pointermove", (e) => {
    if (!now) return;
    const box = screen.getBoundingClientRect();
    const at = (v, size, n) => Math.min(n - 1, Math.max(0, Math.floor(v / size * n)));
    cursor = { x: at(e.clientX - box.left, box.width, now.width), y: at(e.clientY - box.top, box.height, now.height) };
    draw();
  });
  screen.addEventListener("keydown", (e) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key];
    if (!step || !now) return;
    e.preventDefault();
    const by = e.shiftKey ? 10 : 1, from = cursor || { x: now.width >> 1, y: now.height >> 1 };
    cursor = { x: Math.min(now.width - 1, Math.max(0, from.x + by * step[0])),
      y: Math.min(now.height - 1, Math.max(0, from.y + by * step[1])) };
    draw();
  });

  const strip = byId("ramp").getContext("2d");
  for (let x = 0; x < 512; x++) {
    const stop = data.falseLow + x / 512 * (data.falseHigh - data.falseLow);
    const at = 3 * Math.round(255 * (Math.floor(stop * 2) / 2 - data.falseLow) / (data.falseHigh - data.falseLow));
    strip.fillStyle = `rgb(${ramp[at]},${ramp[at + 1]},${ramp[at + 2]})`;
    strip.fillRect(x, 0, 1, 12);
  }
  const nitsAt = (stop) => `${short(data.white * 2 ** stop)} nits`;
  byId("low").textContent = `${data.falseLow} stops`;
  byId("high").textContent = `+${data.falseHigh}`;
  byId("white").textContent = `0: ${nitsAt(0)}`;
  byId("white").style.left = `${100 * -data.falseLow / (data.falseHigh - data.falseLow)}%`;
  show();
})();
