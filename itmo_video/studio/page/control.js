// The control of one setting: a slider with a number, a check box, a choice, or a set of them.

const STEPS = 1000;
let serial = 0;

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

// Between a slider's position, 0 to 1000, and a value; logarithmic if bounds are far apart.
function scale({ lower, upper, by_ratio, kind }) {
  const round = (v) => (kind === "int" ? Math.round(v) : Number(v.toPrecision(4)));
  if (by_ratio) {
    const span = Math.log(upper / lower);
    return { to: (v) => Math.log(Math.max(v, lower) / lower) / span * STEPS,
      from: (s) => round(lower * Math.exp(s / STEPS * span)) };
  }
  return { to: (v) => (v - lower) / (upper - lower) * STEPS,
    from: (s) => round(lower + s / STEPS * (upper - lower)) };
}

function powers(spec, onSet, id) {
  const select = make("select", { id });
  for (let n = spec.lower; n <= spec.upper; n *= 2) select.add(new Option(n, n));
  select.addEventListener("change", () => onSet(Number(select.value), false));
  return { parts: [select], update: ({ value, disabled }) => { select.value = value; select.disabled = disabled; } };
}

function numeric(spec, onSet, id) {
  const [lower, upper] = spec.usual;  // the number field accepts anything within bounds
  const { to, from } = scale({ ...spec, lower, upper });
  const range = make("input", { type: "range", min: 0, max: STEPS, step: 1, tabIndex: -1 });
  range.setAttribute("aria-hidden", "true");
  const number = make("input", { type: "number", id, step: spec.kind === "int" ? 1 : "any",
    min: spec.lower ?? "", max: spec.upper ?? "" });
  // While it is dragged or typed in, the state does not set it back.
  let isDragged = false, isTyped = false;
  range.addEventListener("input", () => {
    isDragged = true;
    number.value = from(Number(range.value));
    onSet(Number(number.value), true);
  });
  range.addEventListener("change", () => { isDragged = false; onSet(Number(number.value), false); });
  number.addEventListener("input", () => { isTyped = true; });
  number.addEventListener("change", () => {
    if (!number.validity.valid) { number.reportValidity(); return; }
    isTyped = false;
    onSet(number.value === "" ? null : Number(number.value), false);
  });
  number.addEventListener("blur", () => { isTyped = false; });
  // Enter accepts the value and returns the keys to the studio; Tab continues from here.
  number.addEventListener("keydown", (e) => { if (e.key === "Enter") number.blur(); });
  return {
    parts: [range, number],
    update: ({ value, derived, disabled }) => {
      const shown = value ?? derived;
      if (!isDragged) range.value = shown === undefined ? 0 : to(shown);
      if (!isTyped && !isDragged)
        number.value = value === null ? "" : Number(Number(value).toPrecision(6));
      number.placeholder = value === null && derived !== undefined ? Number(derived.toPrecision(4)) : "";
      range.disabled = number.disabled = disabled;
    },
  };
}

function box(spec, onSet, id) {
  const input = make("input", { type: "checkbox", id });
  input.addEventListener("change", () => onSet(input.checked, false));
  return { parts: [input], update: ({ value, disabled }) => { input.checked = value; input.disabled = disabled; } };
}

function choice(spec, onSet, id) {
  const select = make("select", { id }, ...spec.choices.map((name) => new Option(name, name)));
  select.addEventListener("change", () => onSet(select.value, false));
  return { parts: [select], update: ({ value, disabled }) => { select.value = value; select.disabled = disabled; } };
}

function words(spec, onSet, id) {
  const input = make("input", { id, spellcheck: false });
  let isTyped = false;
  input.addEventListener("input", () => { isTyped = true; });
  input.addEventListener("change", () => { isTyped = false; onSet(input.value || null, false); });
  return { parts: [input], update: ({ value, disabled }) => {
    if (!isTyped) input.value = value ?? "";
    input.disabled = disabled;
  } };
}

const LAYERS = ["expand_map", "clip_mask", "gain"];
function layers(spec, onSet) {
  const boxes = LAYERS.map((name) => make("input", { type: "checkbox", value: name }));
  const send = () => onSet(boxes.filter((b) => b.checked).map((b) => b.value), false);
  boxes.forEach((b) => b.addEventListener("change", send));
  const parts = boxes.map((b, i) => make("label", { className: "tick" }, b, LAYERS[i].replace("_", " ")));
  return { parts, update: ({ value, disabled }) => boxes.forEach((b) => {
    b.checked = value.includes(b.value);
    b.disabled = disabled;
  }) };
}

function parameters(spec, onSet) {
  const list = make("div", { className: "parameters" });
  let built = null, inner = [], values = {};
  return { parts: [list], update: ({ value, disabled, operator }) => {
    values = value || {};
    if (operator && built !== operator.name) {
      built = operator.name;
      inner = operator.parameters.map((p) => ({ name: p.name, default: p.default, control: control(
        { ...p, usual: [p.lower, p.upper], label: p.name.replaceAll("_", " "), kind: "float", choices: [], flag: p.name },
        (v, isDrag) => {
          const next = { ...values };
          if (v === null) delete next[p.name]; else next[p.name] = v;
          onSet(Object.keys(next).length ? next : null, isDrag);
        }) }));
      list.replaceChildren(...inner.map(({ control: c }) => c.element));
    }
    list.parentElement.hidden = !inner.length;
    for (const { name, default: usual, control: c } of inner)
      c.update({ value: values[name] ?? usual, changed: name in values, disabled });
  } };
}

// `onSet(value, isDrag)` is called with the chosen value; null resets it.
export function control(spec, onSet) {
  const id = `set-${serial++}`;
  const kind = spec.name === "lights" ? powers : spec.name === "operator_params" ? parameters
    : spec.kind === "tuple" ? layers : spec.kind === "bool" ? box
      : spec.choices.length ? choice : spec.kind === "str" ? words : numeric;
  const { parts, update } = kind(spec, onSet, id);
  const name = spec.label[0].toUpperCase() + spec.label.slice(1);
  const label = make("label", { htmlFor: id, textContent: name, title: `${spec.help} (${spec.flag})` });
  const back = make("button", { type: "button", className: "reset", textContent: "↺",
    title: `Reset ${spec.label}` });
  back.setAttribute("aria-label", `Reset ${spec.label}`);
  back.addEventListener("click", () => onSet(null, false));
  const element = make("div", { className: `control ${kind.name}` }, label, ...parts, back);
  element.dataset.setting = spec.name;
  return { element, update: (state) => {
    element.classList.toggle("changed", Boolean(state.changed));
    element.classList.toggle("dim", Boolean(state.disabled));
    back.disabled = !state.changed || state.disabled;
    update(state);
  } };
}
