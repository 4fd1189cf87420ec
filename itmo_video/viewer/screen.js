// The picture on screen: fit or 100 %, a draggable divider, the probe's cross, and lights.

const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Screen {
  // `box` contains the canvas, the overlay canvas and the divider; `size` is that of the full
  // picture. Arrow keys move the probe, together with Alt if `keys` says so.
  constructor({ box, canvas, overlay, divider, size, aspect, keys = "alt", onProbe, onDivide }) {
    Object.assign(this, { box, canvas, overlay, divider, size, aspect, keys, onProbe, onDivide });
    this.split = 0.5;
    this.zoom = "fit";
    this.probe = null;
    this.lights = [];
    this.shows = { divider: false, lights: false };
    this.frame = canvas.parentElement;
    for (const part of [overlay, divider])  // the divider's handle lies over the picture, too
      part.addEventListener("pointermove", (e) => {
        if (e.buttons === 0) this.#probeAt(...this.#place(e));
      });
    overlay.addEventListener("pointerdown", (e) => this.#press(e));
    canvas.addEventListener("keydown", (e) => this.#key(e));
    divider.addEventListener("pointerdown", (e) => this.#drag(e));
    divider.addEventListener("keydown", (e) => {
      const by = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
      if (!by) return;
      e.preventDefault();
      e.stopPropagation();
      this.divide(this.split + by * (e.shiftKey ? 0.1 : 0.01));
    });
    new ResizeObserver(() => this.layout()).observe(box);
  }

  #place(e) {
    const area = this.overlay.getBoundingClientRect();
    return [(e.clientX - area.left) / area.width, (e.clientY - area.top) / area.height]
      .map((part) => Math.min(0.999999, Math.max(0, part)));
  }

  #press(e) {
    const [x, y] = this.#place(e), reach = 14 / this.overlay.clientWidth;
    if (this.shows.divider && Math.abs(x - this.split) < reach) this.#drag(e);
    else this.#probeAt(x, y);
  }

  #drag(e) {
    e.preventDefault();
    const move = (event) => this.divide(this.#place(event)[0]);
    const end = () => {
      window.removeEventListener("pointermove", move);
      window.removeEventListener("pointerup", end);
    };
    window.addEventListener("pointermove", move);
    window.addEventListener("pointerup", end);
    this.divider.focus();
  }

  divide(split) {
    this.split = Math.min(1, Math.max(0, split));
    this.mark();
    this.onDivide(this.split);
  }

  #probeAt(x, y) {
    this.probe = [x, y];
    this.mark();
    this.onProbe(x, y);
  }

  #key(e) {
    const step = KEYS[e.key];
    if (!step || e.altKey !== (this.keys === "alt")) return;
    e.preventDefault();
    e.stopPropagation();
    const by = e.shiftKey ? 10 : 1, [x, y] = this.probe || [0.5, 0.5];
    this.#probeAt(Math.min(0.999999, Math.max(0, x + by * step[0] / this.size[0])),
      Math.min(0.999999, Math.max(0, y + by * step[1] / this.size[1])));
  }

  setZoom(zoom) {
    this.zoom = zoom;
    this.layout();
  }

  // Sizes the picture in the box: to fit, or one pixel of the file per pixel of the monitor.
  layout() {
    const [width, height] = [this.size[0] * this.aspect, this.size[1]];
    let scale = 1 / (window.devicePixelRatio || 1);
    if (this.zoom === "fit")
      scale = Math.min(this.box.clientWidth / width, this.box.clientHeight / height);
    this.box.classList.toggle("scrolls", this.zoom !== "fit");
    this.frame.style.width = `${Math.max(1, Math.floor(width * scale))}px`;
    this.frame.style.height = `${Math.max(1, Math.floor(height * scale))}px`;
    this.mark();
  }

  // Draws the overlays.
  mark() {
    const ratio = window.devicePixelRatio || 1, { overlay } = this;
    const width = Math.round(overlay.clientWidth * ratio), height = Math.round(overlay.clientHeight * ratio);
    if (overlay.width !== width || overlay.height !== height) Object.assign(overlay, { width, height });
    const context = overlay.getContext("2d");
    context.clearRect(0, 0, width, height);
    this.divider.hidden = !this.shows.divider;
    this.divider.style.left = `${100 * this.split}%`;
    this.divider.setAttribute("aria-valuenow", Math.round(100 * this.split));
    if (this.shows.lights)
      for (const [x, y] of this.lights) {
        context.fillStyle = "#000";
        context.fillRect(x * width - 2 * ratio, y * height - 2 * ratio, 4 * ratio, 4 * ratio);
        context.fillStyle = "#f0e442";
        context.fillRect(x * width - ratio, y * height - ratio, 2 * ratio, 2 * ratio);
      }
    if (!this.probe) return;
    const [x, y] = [this.probe[0] * width, this.probe[1] * height];
    for (const [style, wide] of [["#000", 3], ["#fff", 1]]) {
      context.strokeStyle = style;
      context.lineWidth = wide * ratio;
      context.strokeRect(x - 5 * ratio, y - 5 * ratio, 10 * ratio, 10 * ratio);
    }
  }
}
