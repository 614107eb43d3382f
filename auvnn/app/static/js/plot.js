// Traces that share one time axis: linked cursors, zoom by dragging or by keys, finer data where one zooms in.

import { h, number } from "./dom.js";

const { uPlot } = window;
let groups = 0;

export function ink(name) { return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim(); }

const LOOKS = {
  measured: { colour: "measured", width: 1 },
  given: { colour: "given", width: 1.3, dash: [5, 3] },
  after: { colour: "after", width: 2 },
  residual: { colour: "after", width: 1.1 },
  refitted: { colour: "refitted", width: 1.3, dash: [9, 3, 2, 3] },
  one: { colour: "after", width: 1.2 }, two: { colour: "given", width: 1.2 }, three: { colour: "third", width: 1.2 },
  four: { colour: "measured", width: 1 }, five: { colour: "refitted", width: 1 }, six: { colour: "sixth", width: 1 },
  seven: { colour: "seventh", width: 1 }, eight: { colour: "eighth", width: 1 },
};
export const SEVERAL = ["one", "two", "three", "four", "five", "six", "seven", "eight"];

export class Group {
  // load(from, to, points) gives {t, series}.
  constructor(load) {
    this.load = load;
    this.key = `g${groups++}`;
    this.plots = [];
    this.range = null;
    this.extent = null;
    this.bands = [];
    this.asked = 0;
    this.onzoom = null;
  }

  // Returns a figure: a caption, a key that gives the values under the cursor, and the plot.
  add({ title, label, unit, series, height = 150, zero = false, named = true }) {
    const holder = h("div", { class: "plot", role: "img", "aria-label": label });
    const said = series.map(() => h("span", { class: "value" }));
    const at = h("span", { class: "value" });
    const plot = { holder, label, unit, series, height, zero, chart: null, said, at };
    this.plots.push(plot);
    const legend = h("ul", { class: "key live" }, h("li", {}, at), series.map((one, k) =>
      h("li", {}, h("span", { class: `swatch ${one.look}`, "aria-hidden": "true" }), named ? one.label : null, said[k])));
    if (!named) legend.classList.add("bare");
    new ResizeObserver(() => {
      const width = holder.clientWidth;
      if (plot.chart && width > 40 && Math.abs(width - plot.chart.width) > 1) plot.chart.setSize({ width, height });
      else if (!plot.chart && width > 40 && this.data) this.draw(plot);
    }).observe(holder);
    return h("figure", {}, h("figcaption", {}, h("span", {}, title), legend), holder);
  }

  controls() {
    const button = (label, words, act) => h("button", { type: "button", class: "small", "aria-label": label, title: label, onclick: act }, words);
    return h("div", { class: "controls", role: "group", "aria-label": "Zoom" },
      button("Earlier", "◀", () => this.shift(-0.5)), button("Later", "▶", () => this.shift(0.5)),
      button("Zoom in", "+", () => this.scale(0.5)), button("Zoom out", "−", () => this.scale(2)),
      button("Show all of the run", "All", () => this.zoom(null)));
  }

  scale(factor) {
    const [low, high] = this.range || this.extent;
    const middle = 0.5 * (low + high), half = 0.5 * (high - low) * factor;
    this.zoom([middle - half, middle + half]);
  }

  shift(share) {
    if (!this.range) return;
    const [low, high] = this.range;
    const step = share * (high - low);
    this.zoom([low + step, high + step]);
  }

  zoom(range) {
    if (range && this.extent) {
      range = [Math.max(range[0], this.extent[0]), Math.min(range[1], this.extent[1])];
      if (!(range[1] > range[0])) return Promise.resolve();
      if (range[0] === this.extent[0] && range[1] === this.extent[1]) range = null;
    }
    this.range = range;
    if (this.onzoom) this.onzoom(range);
    return this.refresh();
  }

  mark(bands) {
    this.bands = bands;
    for (const plot of this.plots) if (plot.chart) plot.chart.redraw(false);
  }

  async refresh() {
    const turn = ++this.asked;
    const width = Math.max(...this.plots.map((p) => p.holder.clientWidth), 400);
    const [from, to] = this.range || [null, null];
    const data = await this.load(from, to, Math.min(2 * width, 2400));
    if (turn === this.asked && data) this.set(data);
  }

  set(data) {
    this.data = data;
    const t = data.t;
    if (!this.range && t.length) this.extent = [t[0], t[t.length - 1]];
    for (const plot of this.plots) this.draw(plot);
  }

  columns(plot) { return [this.data.t, ...plot.series.map((one) => this.data.series[one.key] || this.data.t.map(() => null))]; }

  draw(plot) {
    const columns = this.columns(plot);
    const [min, max] = this.range || this.extent || [0, 1];
    if (plot.chart) {
      plot.chart.batch(() => {
        plot.chart.setData(columns, false);
        plot.chart.setScale("x", { min, max });
        // Where the range has not changed, setting it draws nothing.
        plot.chart.redraw(true, false);
      });
      return;
    }
    const width = plot.holder.clientWidth;
    if (width <= 40) return;
    const group = this;
    const axis = { stroke: () => ink("soft"), grid: { stroke: () => ink("grid"), width: 1 }, ticks: { stroke: () => ink("grid"), width: 1, size: 4 }, font: "11px system-ui, sans-serif", labelFont: "11px system-ui, sans-serif" };
    plot.chart = new uPlot({
      width, height: plot.height, ms: 1,
      scales: {
        x: { time: false, min, max },
        y: { range: (u, low, high) => plot.zero ? uPlot.rangeNum(Math.min(low, 0), Math.max(high, 0), 0.1, true) : uPlot.rangeNum(low, high, 0.1, false) },
      },
      legend: { show: false },
      cursor: {
        sync: { key: this.key, setSeries: false }, drag: { x: true, y: false, setScale: false },
        bind: { dblclick: () => () => { group.zoom(null); return null; } },
        points: { size: 5 },
      },
      axes: [
        // Time in seconds: the unit stands at the first tick, where there is room for it.
        { ...axis, size: 26, space: 70, values: (u, ticks) => ticks.map((v, k) => (k ? number(v, 6) : `${number(v, 6)} s`)) },
        { ...axis, size: 50, space: 20, label: plot.unit, labelSize: 15, labelGap: 0, values: (u, ticks) => ticks.map((v) => number(v, 4)) },
      ],
      series: [
        { label: "t" },
        ...plot.series.map((one) => {
          const look = LOOKS[one.look];
          return {
            label: one.label, stroke: () => ink(look.colour), width: look.width, dash: look.dash, spanGaps: false, points: { show: false },
          };
        }),
      ],
      hooks: {
        drawClear: [(u) => group.shade(u)],
        setCursor: [(u) => {
          const at = u.cursor.idx, here = at !== null && at !== undefined && u.cursor.left >= 0;
          plot.at.textContent = here ? `${u.data[0][at].toFixed(2)} s` : "";
          plot.said.forEach((place, k) => { const v = here ? u.data[k + 1][at] : null; place.textContent = v === null || v === undefined ? "" : number(v, 3); });
        }],
        setSelect: [(u) => {
          if (u.select.width < 4) return;
          const range = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
          u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          group.zoom(range);
        }],
      },
    }, columns, plot.holder);
  }

  // Stretches that were marked lie behind the traces; none is thinner than can be seen.
  shade(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const band of this.bands) {
      const left = u.valToPos(band.from, "x", true), right = u.valToPos(band.to, "x", true);
      const width = Math.max(right - left, 2 * window.devicePixelRatio);
      ctx.fillStyle = ink(band.tone || "mark");
      ctx.fillRect(left, bbox.top, width, bbox.height);
    }
    ctx.restore();
  }

  repaint() { for (const plot of this.plots) if (plot.chart) plot.chart.redraw(false, true); }

  destroy() { for (const plot of this.plots) if (plot.chart) { plot.chart.destroy(); plot.chart = null; } }
}

export function key(...entries) {
  return h("ul", { class: "key" }, entries.map(([look, words]) =>
    h("li", {}, h("span", { class: `swatch ${look}`, "aria-hidden": "true" }), words)));
}
