// Small drawings without a time axis: error against horizon, the waterfall, intervals.

import { h, number, s } from "./dom.js";

const HORIZONS = ["0.5", "1", "2", "5", "10", "full"];

function line(points, kind) {
  const known = points.filter((p) => p !== null);
  return known.length ? s("g", { class: kind }, s("polyline", { points: known.map((p) => p.join(",")).join(" ") }), known.map(([x, y]) => s("circle", { cx: x, cy: y, r: 2.6 }))) : null;
}

// rows: [[class, words, {horizon: error}]]
export function againstHorizon(rows, horizons = HORIZONS) {
  const there = horizons.filter((x) => rows.some(([, , errors]) => Number.isFinite(errors[x])));
  const values = rows.flatMap(([, , errors]) => there.map((x) => errors[x])).filter((v) => Number.isFinite(v) && v > 0);
  if (!values.length) return h("p", { class: "soft" }, "No horizon fits into this log.");
  const low = Math.floor(Math.log10(Math.min(...values)) * 2) / 2, high = Math.ceil(Math.log10(Math.max(...values)) * 2) / 2;
  const W = 440, H = 230, left = 46, right = 20, top = 12, bottom = 34;
  const x = (k) => left + (W - left - right) * (there.length > 1 ? k / (there.length - 1) : 0.5);
  const y = (v) => top + (H - top - bottom) * (1 - (Math.log10(v) - low) / Math.max(high - low, 0.5));
  const ticks = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30].filter((v) => Math.log10(v) >= low - 0.01 && Math.log10(v) <= high + 0.01);
  const words = rows.map(([, name, errors]) => `${name}: ${there.map((t) => `${t === "full" ? "whole run" : `${t} s`} ${number(errors[t])}`).join(", ")}`).join(". ");
  return s("svg", { class: "chart", viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": `Error against horizon. ${words}` },
    ticks.map((v) => s("g", { class: "tick" }, s("line", { x1: left, x2: W - right, y1: y(v), y2: y(v) }), s("text", { x: left - 6, y: y(v) + 3.5, "text-anchor": "end" }, v))),
    there.map((t, k) => s("text", { x: x(k), y: H - 16, "text-anchor": "middle", class: "label" }, t === "full" ? "whole" : t)),
    s("text", { x: (left + W - right) / 2, y: H - 2, "text-anchor": "middle", class: "label" }, "seconds of free running"),
    rows.map(([kind, , errors]) => line(there.map((t, k) => (Number.isFinite(errors[t]) && errors[t] > 0 ? [x(k).toFixed(1), y(errors[t]).toFixed(1)] : null)), kind)));
}

// steps: [{step, error}], the last one the noise floor.
export function waterfall(steps) {
  const known = steps.filter((one) => Number.isFinite(one.error));
  const high = Math.max(...known.map((one) => one.error), 1e-12) * 1.05;
  return h("ol", { class: "waterfall", "aria-label": "Held-out error after each step" }, steps.map((one) => {
    const bar = h("span", { class: "bar" });
    bar.style.setProperty("width", `${Number.isFinite(one.error) ? Math.max(100 * one.error / high, 0.6) : 0}%`);
    const kind = one.step === "noise floor" ? "floor" : one.step === "as given" ? "given" : one.step === "coefficients refitted" ? "refitted" : "after";
    return h("li", { class: kind }, h("span", { class: "step" }, one.step), h("span", { class: "track", "aria-hidden": "true" }, bar), h("span", { class: "value" }, number(one.error)));
  }));
}

// An interval of 95 % on a line that holds zero or another null.
export function interval(value, std, low, high, none) {
  const W = 160, place = (v) => 4 + (W - 8) * Math.min(Math.max((v - low) / (high - low || 1), 0), 1);
  const half = Number.isFinite(std) && std > 0 ? 1.96 * std : 0;
  return s("svg", { class: "interval", viewBox: `0 0 ${W} 16`, width: W, height: 16, "aria-hidden": "true" },
    s("line", { class: "axis", x1: 4, x2: W - 4, y1: 8, y2: 8 }),
    none >= low && none <= high ? s("line", { class: "null", x1: place(none), x2: place(none), y1: 2, y2: 14 }) : null,
    s("line", { class: "width", x1: place(value - half), x2: place(value + half), y1: 8, y2: 8 }),
    s("circle", { cx: place(value), cy: 8, r: 4 }));
}
