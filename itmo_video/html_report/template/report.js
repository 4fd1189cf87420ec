// The report's viewer: the frames in the page, by the same parts as the studio's.

import { draw } from "viewer/draw.js";
import { bands, legend } from "viewer/false_colour.js";
import { Picture, probe, short } from "viewer/light.js";
import { drawScope } from "viewer/scopes.js";
import { Screen } from "viewer/screen.js";

const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const frameInput = byId("frame"), split = byId("split"), canvas = byId("screen");
const cache = new Map();
let now = null, turn = 0, playing = 0;

// Light by 11-bit code (black is code 0), by a monitor's 8-bit code, and by a map's 8 bits.
const hdrLight = Float32Array.from({ length: data.codes + 1 }, (_, c) =>
  c && 2 ** ((c - 1) / (data.codes - 1) * (data.highest - data.lowest) + data.lowest));
const sdrLight = Float32Array.from({ length: 256 }, (_, c) => (c / 255) ** 2.4);
const mapLight = Float32Array.from({ length: 256 }, (_, c) => c / 255);

async function pixels(uri) {
  const image = new Image();
  image.src = uri;
  await image.decode();
  const { naturalWidth: width, naturalHeight: height } = image;
  const context = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  return context.getImageData(0, 0, width, height);
}

function planar({ width, height, data: rgba }, channels, light) {
  const n = width * height, codes = new Uint16Array(channels * n);
  for (let p = 0; p < n; p++) for (let k = 0; k < channels; k++) codes[p + k * n] = rgba[4 * p + k];
  return new Picture({ width, height, channels, codes, light, primaries: data.primaries });
}

async function load(i) {
  if (cache.has(i)) return cache.get(i);
  const frame = data.frames[i], [width, height] = frame.size, n = width * height;
  const both = (await pixels(frame.hdr)).data, codes = new Uint16Array(3 * n);
  for (let p = 0; p < n; p++)
    for (let k = 0; k < 3; k++)
      codes[p + k * n] = both[4 * p + k] << 3 | both[4 * (p + n) + k] >> 5;
  const loaded = {
    number: frame.number,
    hdr: new Picture({ width, height, channels: 3, codes, light: hdrLight, primaries: data.primaries }),
    sdr: frame.source ? planar(await pixels(frame.source), 3, sdrLight) : null,
    map: frame.map ? planar(await pixels(frame.map), 1, mapLight) : null,
  };
  if (cache.size > 47) cache.delete(cache.keys().next().value);
  cache.set(i, loaded);
  return loaded;
}

const chosen = (name) => document.querySelector(`input[name=${name}]:checked`).value;
const gainOf = (id) => 2 ** Number(byId(id)?.value ?? 0);

const screen = new Screen({
  box: byId("box"), canvas, overlay: byId("marks"), divider: byId("divider"), keys: "plain",
  size: data.frames[0].size, aspect: data.aspect, onProbe: tell,
  onDivide: (at) => { split.value = 100 * at; paint(); },
});

function paint() {
  if (!now) return;
  const view = chosen("view"), peak = data.peak, { hdr, sdr, map } = now;
  const right = { picture: hdr, other: sdr, view, from: 0, to: 1, gain: gainOf("exposure"),
    toneMap: byId("tone-map").value, tint: byId("map")?.checked ? map : null };
  const left = { picture: sdr, view: view === "false" ? "false" : "picture", from: 0, to: screen.split,
    gain: gainOf("exposure-sdr"), toneMap: "clip" };
  draw(canvas, sdr ? [left, { ...right, from: screen.split }] : [right], { white: data.white, peak });
  screen.shows.divider = Boolean(sdr);
  screen.mark();
  byId("legend").hidden = view !== "false";
  if (view === "false") legend(byId("legend"), bands(data.white, peak * data.white), short);
  if (!playing) drawScope(byId("scope"), byId("scope-kind").value, hdr, data.white);
  words();
  tell();
}

function words() {
  byId("frame-told").textContent = String(now.number);
  for (const id of ["exposure", "exposure-sdr"])
    if (byId(id)) byId(`${id}-told`).textContent = `${Number(byId(id).value).toFixed(1)} stops`;
  if (split) byId("split-told").textContent = `${Math.round(split.value)} %`;
  frameInput.setAttribute("aria-valuetext", `frame ${now.number}`);
  for (const line of document.querySelectorAll("svg .now")) {
    const x = data.left + data.positions[Number(frameInput.value)] * data.across;
    line.setAttribute("x1", x);
    line.setAttribute("x2", x);
  }
}

function tell() {
  if (!screen.probe || !now) return;
  const [x, y] = screen.probe, { hdr, sdr } = now, out = byId("read-out");
  const line = (picture) => {
    const told = probe(picture, picture.at(x, y), data.white);
    const stops = told.stops === null ? "black"
      : `${told.stops >= 0 ? "+" : ""}${told.stops.toFixed(2)} stops relative to SDR white`;
    const uv = told.uv ? `, u′v′ ${told.uv.map((v) => v.toFixed(4)).join(" ")}` : "";
    return [`${short(told.nits)} nits, ${stops}${uv}; R, G, B ${told.rgb.map(short).join(", ")}`, told.nits];
  };
  const [text, nits] = line(hdr), column = Math.floor(x * hdr.width), row = Math.floor(y * hdr.height);
  Object.assign(out.dataset, { nits, x: column, y: row });
  out.textContent = `(${column}, ${row}): ${text}${sdr ? `\nbefore: ${line(sdr)[0]}` : ""}`;
}

async function show() {
  const mine = ++turn;
  canvas.setAttribute("aria-busy", "true");
  const loaded = await load(Number(frameInput.value));
  if (mine !== turn) return;  // a later frame has been requested since
  now = loaded;
  paint();
  canvas.dataset.frame = now.number;
  canvas.setAttribute("aria-busy", "false");
}

// Plays the embedded frames, each for as long as the clip takes to reach the next of them.
async function play() {
  const mine = ++playing;
  byId("play").setAttribute("aria-pressed", "true");
  while (mine === playing) {
    const began = performance.now();
    frameInput.value = (Number(frameInput.value) + 1) % data.frames.length;
    await show();
    const wait = 1000 * data.step_s - (performance.now() - began);
    await new Promise((done) => setTimeout(done, Math.max(10, wait)));
  }
}

function pause() {
  playing = 0;
  byId("play").setAttribute("aria-pressed", "false");
  paint();
}

byId("play").addEventListener("click", () => (playing ? pause() : play()));
frameInput.addEventListener("input", show);
split?.addEventListener("input", () => screen.divide(Number(split.value) / 100));
for (const input of document.querySelectorAll(
  "#exposure, #exposure-sdr, #tone-map, #scope-kind, input[name=view], #map"))
  input.addEventListener("input", paint);
document.addEventListener("keydown", (e) => {
  if (e.target.closest("input, select, button") || e.ctrlKey || e.altKey || e.metaKey) return;
  if (e.key === " ") { e.preventDefault(); byId("play").click(); }
});
show();
