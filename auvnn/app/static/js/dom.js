// Elements made of text nodes alone: nothing that comes from a log is ever read as markup.

const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [key, value] of Object.entries(attributes || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "value" && "value" in element) element.value = value;
    else if (key === "checked" || key === "disabled" || key === "hidden" || key === "open" || key === "selected") element[key] = Boolean(value);
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  for (const child of children.flat(4)) {
    if (child === null || child === undefined || child === false) continue;
    element.append(child instanceof Node ? child : document.createTextNode(String(child)));
  }
  return element;
}

export function h(tag, attributes, ...children) {
  const element = document.createElement(tag);
  // A select takes its value only once its options are there.
  const late = tag === "select" && attributes && "value" in attributes ? attributes.value : undefined;
  fill(element, attributes, children);
  if (late !== undefined) element.value = late;
  return element;
}

export function s(tag, attributes, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

export function show(element, ...children) {
  element.replaceChildren(...children.flat(4).filter((c) => c !== null && c !== undefined && c !== false));
  return element;
}

export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "unknown";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-4) return value.toExponential(digits - 1).replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}

// A value to as many digits as its standard error deserves.
export function measured(value, std, unit) {
  const shown = unit && unit !== "1" ? ` ${unit}` : "";
  if (value === null || value === undefined || !Number.isFinite(value)) return `unknown${shown}`;
  if (!std || !Number.isFinite(std) || std <= 0) return `${number(value, 4)}${shown}`;
  const digits = Math.min(Math.max(Math.floor(1 - Math.floor(Math.log10(std))), 0), 9);
  return `${value.toFixed(digits)} ± ${std.toFixed(digits)}${shown}`;
}

export function percent(value, digits = 0) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "unknown";
  const size = 100 * value;
  if (size > 0 && size < 0.1) return "<0.1 %";
  return `${size.toFixed(Math.abs(size) < 1 ? 1 : digits)} %`;
}

export function chance(p) {
  if (p === null || p === undefined) return "unknown";
  return p < 1e-4 ? "p < 0.0001" : `p = ${number(p, 2)}`;
}

export function duration(seconds) {
  if (seconds < 90) return `${number(seconds, 3)} s`;
  if (seconds < 5400) return `${number(seconds / 60, 3)} min`;
  return `${number(seconds / 3600, 3)} h`;
}

export const DOF = [
  { velocity: "u", axis: "X", word: "surge", unit: "m/s", force: "N" },
  { velocity: "v", axis: "Y", word: "sway", unit: "m/s", force: "N" },
  { velocity: "w", axis: "Z", word: "heave", unit: "m/s", force: "N" },
  { velocity: "p", axis: "K", word: "roll", unit: "rad/s", force: "N m" },
  { velocity: "q", axis: "M", word: "pitch", unit: "rad/s", force: "N m" },
  { velocity: "r", axis: "N", word: "yaw", unit: "rad/s", force: "N m" },
];

export function plural(count, word) {
  return `${count.toLocaleString("en")} ${word}${count === 1 ? "" : "s"}`;
}

// Words that a program gives as a clause, as a sentence.
export function sentence(words) {
  return words ? `${words.charAt(0).toUpperCase()}${words.slice(1)}.` : "";
}

export function card(title, ...children) {
  const id = `t${Math.random().toString(36).slice(2, 9)}`;
  return h("section", { class: "card", "aria-labelledby": id }, h("h2", { id }, title), children);
}

export function choice(label, options, value, change) {
  return h("label", { class: "choice" }, h("span", {}, label),
    h("select", { onchange: (e) => change(e.target.value), value },
      options.map(([key, words]) => h("option", { value: key }, words))));
}
