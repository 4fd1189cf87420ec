// False colour in steps of round nits: blues and greys up to SDR white, oranges above. The break is
// visible to colour-blind people, and every step is lighter than the one before.

const STEPS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 400, 600, 1000, 2000, 4000, 10000];
const BELOW = [[4, 8, 28], [0, 60, 130], [86, 140, 190], [190, 205, 215]];
const ABOVE = [[150, 50, 0], [230, 120, 0], [250, 190, 60], [255, 250, 225]];

function along(stops, t) {
  const at = Math.min(stops.length - 1.000001, Math.max(0, t) * (stops.length - 1));
  const i = Math.floor(at), part = at - i;
  return stops[i].map((value, k) => Math.round(value + part * (stops[i + 1][k] - value)));
}

// The bands for a white and a peak in nits: {from, to, colour, isAbove}, dark to bright.
export function bands(white, peak) {
  const edges = STEPS.filter((nits) => Math.abs(nits / white - 1) > 0.1 && nits < peak * 0.999);
  const below = [0, ...edges.filter((nits) => nits < white)];
  const above = [white, ...edges.filter((nits) => nits > white)];
  const ends = [...below.slice(1), white, ...above.slice(1), Infinity];
  return [...below, ...above].map((from, i) => {
    const isAbove = i >= below.length, [list, stops] = isAbove ? [above, ABOVE] : [below, BELOW];
    const place = isAbove ? i - below.length : i;
    const colour = along(stops, list.length > 1 ? place / (list.length - 1) : 1);
    return { from, to: ends[i], colour, isAbove };
  });
}

// A function from nits to 32-bit RGBA.
export function painter(list) {
  const packed = list.map(({ colour: [r, g, b] }) => (255 << 24 | b << 16 | g << 8 | r) >>> 0);
  const edges = Float64Array.from(list, (band) => band.from);
  return (nits) => {
    let low = 0, high = edges.length;
    while (high - low > 1) {
      const middle = low + high >> 1;
      if (nits >= edges[middle]) low = middle; else high = middle;
    }
    return packed[low];
  };
}

// Fills `element` with a legend: swatches with round nits, and a label for SDR white.
export function legend(element, list, short) {
  element.replaceChildren(...list.map(({ from, colour, isAbove }, i) => {
    const item = document.createElement("li"), swatch = document.createElement("i");
    swatch.style.background = `rgb(${colour})`;
    const breaks = isAbove && !list[i - 1].isAbove;
    item.classList.toggle("white", breaks);
    item.append(swatch, breaks ? `${short(from)} white` : short(from));
    return item;
  }));
}
