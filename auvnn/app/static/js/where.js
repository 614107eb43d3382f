// Where the model fails: traces by degree of freedom, error against horizon, and the map of the residual.

import { attempt, get } from "./api.js";
import { againstHorizon } from "./charts.js";
import { card, choice, DOF, duration, h, number, percent, show } from "./dom.js";
import { Group, key } from "./plot.js";

export class WhereScreen {
  constructor(app) {
    this.app = app;
    this.element = h("div", { class: "screen where" });
    this.seen = "";
    this.dof = null;
    this.run = null;
    this.regime = null;
    this.cell = null;
    this.group = null;
  }

  async update(state) {
    const done = state.answers.comparison;
    const key_ = JSON.stringify([done && done.summary, done && done.stale, Boolean(done && done.report), state.history.length, Boolean(state.log)]);
    if (key_ === this.seen) return;
    const only = this.seen && this.answer && JSON.parse(this.seen)[0] && done && JSON.stringify(JSON.parse(this.seen)[0]) === JSON.stringify(done.summary) && JSON.parse(this.seen)[1] === done.stale;
    this.seen = key_;
    if (!done) { this.begin(state); return; }
    if (only) { this.foot(state); return; }
    const found = await attempt(async () => Promise.all([get("answer", { kind: "comparison" }), get("where"), get("log")]));
    if (!found) return;
    [this.answer, this.map, this.log] = found;
    this.draw(state);
  }

  begin(state) {
    const ready = state.log && state.log.ready && state.history.length;
    show(this.element, card("Not compared yet",
      h("p", {}, "The model runs free from measured states, and its residual is sorted by speed, turn rate, heading, depth, command and time. Nothing is fitted here."),
      h("p", { class: "row" }, ready
        ? h("button", { type: "button", class: "primary", id: "compare", onclick: (e) => this.app.start("compare", [], e.target) }, "Compare model and log")
        : h("a", { href: "#log", class: "button" }, "Choose a log and a model first"))));
  }

  draw(state) {
    if (this.group) this.group.destroy();
    const answer = this.answer;
    const lack = (d) => { const w = answer.residual_wrench[d.axis]; return w.noise_floor > 0 ? w.rms / w.noise_floor : 0; };
    if (!this.dof) this.dof = [...DOF].sort((a, b) => lack(b) - lack(a))[0];
    if (this.run === null) this.run = this.log.fit_runs[0].number;
    this.regimes = Object.keys(this.map.regimes);
    if (!this.regimes.includes(this.regime)) this.regime = this.regimes[0];
    this.foot_ = h("div", { class: "next" });
    this.plots = h("div", {});
    show(this.element,
      answer.warnings.length > 0 && h("details", { class: "note" }, h("summary", {}, `${answer.warnings.length} ${answer.warnings.length === 1 ? "thing" : "things"} to know before reading on`), h("ul", {}, answer.warnings.map((w) => h("li", {}, w)))),
      this.figures(),
      h("div", { class: "two wide-left" }, this.traces(lack), h("div", { class: "stack" }, this.horizon(), this.places())),
      this.residual(),
      this.foot_);
    this.foot(state);
    this.pick(this.dof);
  }

  figures() {
    const five = this.answer.rollout["5"] || {}, floor = this.answer.more.floors["5"], base = this.answer.baseline;
    const box = (value, words, kind) => h("div", { class: `figure ${kind || ""}` }, h("p", { class: "value" }, number(value)), h("p", { class: "soft" }, words));
    const worse = Number.isFinite(five.total) && Number.isFinite(five.persistence) && five.total >= five.persistence;
    return h("div", {}, h("div", { class: "figures" },
      box(five.total, "error of 5 s free running, in standard deviations of the motion", worse ? "bad" : ""),
      box(five.persistence, "the same for holding the speed"),
      base && Number.isFinite(base.total) && box(base.total, "the same for a plain regression fitted to the log"),
      box(floor, "noise floor: a perfect model would show this")),
    worse && h("p", { class: "bad" }, "The model predicts no better than holding the speed does."));
  }

  traces(lack) {
    this.group = new Group((from, to, points) => get("where-traces", { run: this.run, from, to, points }));
    const tabs = h("div", { class: "tabs", role: "group", "aria-label": "Degree of freedom" }, DOF.map((d) => h("button", { type: "button", "data-dof": d.axis, onclick: () => this.pick(d) },
      d.word, h("span", { class: "soft" }, `${number(lack(d), 2)} × floor`))));
    const runs = this.log.fit_runs;
    return card("Measured and model",
      tabs,
      h("div", { class: "row spread" }, runs.length > 1 ? choice("Run", runs.map((r) => [r.number, `${r.number} (${duration(r.end - r.begin)})`]), this.run, (v) => { this.run = Number(v); this.shade(); this.group.zoom(null); }) : h("span", {}), this.group.controls()),
      this.plots, h("p", { class: "soft" }, "The model starts again from measured states every 5 s. Drag over a plot to zoom in; double-click shows all."));
  }

  pick(dof) {
    this.dof = dof;
    for (const button of this.element.querySelectorAll("[data-dof]")) button.setAttribute("aria-pressed", String(button.dataset.dof === dof.axis));
    this.group.destroy();
    this.group.plots = [];
    const wrench = this.answer.residual_wrench[dof.axis];
    show(this.plots,
      this.group.add({ title: `${dof.velocity}, ${dof.word}`, label: `${dof.word} velocity ${dof.velocity}, measured and model`, unit: dof.unit, height: 210,
        series: [{ key: `${dof.velocity}_model`, label: "model", look: "given" }, { key: dof.velocity, label: "measured", look: "measured" }] }),
      this.group.add({ title: `${dof.axis}, what the model lacks: rms ${number(wrench.rms)} ${dof.force}, noise floor ${number(wrench.noise_floor)} ${dof.force}`, label: `Residual ${dof.axis} over time`, unit: dof.force, height: 150, zero: true,
        series: [{ key: dof.axis, label: "residual", look: "residual" }] }));
    attempt(() => this.group.refresh());
    this.paint();
  }

  horizon() {
    const rows = this.answer.rollout, of = (name) => Object.fromEntries(Object.entries(rows).map(([k, v]) => [k, v[name]]));
    const base = this.answer.baseline_rollout || (this.answer.baseline && Number.isFinite(this.answer.baseline.total) && { [this.answer.baseline.horizon || "5"]: this.answer.baseline.total });
    const lines = [["given", "model", of("total")], ["persistence", "holding the speed", of("persistence")], ...(base ? [["refitted", "plain regression", base]] : []), ["floor", "noise floor", this.answer.more.floors]];
    return card("Error against horizon", againstHorizon(lines), key(...lines.map(([kind, words]) => [kind, words])));
  }

  places() {
    const fails = this.answer.failures;
    if (!fails.length) return card("Where the error sits", h("p", { class: "good" }, "Nowhere above the noise floor."));
    return card("Where the error sits", h("ol", { class: "places" }, fails.map((f) => {
      const dof = DOF.find((d) => d.axis === f.channel);
      return h("li", {}, h("button", { type: "button", class: "link", onclick: () => dof && this.pick(dof) }, f.where), h("span", { class: "soft" }, ` ${percent(f.share)} of the error`));
    })));
  }

  residual() {
    if (!this.regimes.length) return card("Map of the residual", h("p", { class: "soft" }, "The log is too short to be sorted."));
    this.grid = h("div", {});
    const holder = card("Map of the residual",
      h("div", { class: "tabs", role: "group", "aria-label": "Sorted by" }, this.regimes.map((name) => h("button", { type: "button", "data-regime": name, onclick: () => { this.regime = name; this.cell = null; this.shade(); this.cells(); } }, name))),
      this.grid, h("p", { class: "soft" }, "Residual over its noise floor. A click on a cell marks its samples in the traces above; arrow keys move between cells."));
    this.cells();
    return holder;
  }

  cells() {
    const place = this.map.regimes[this.regime];
    const bins = place.count.length;
    const all = DOF.flatMap((d, row) => place.rms[row].map((rms) => (rms !== null && this.map.floor[d.axis] > 0 ? rms / this.map.floor[d.axis] : 0)));
    const most = Math.max(...all, 10);
    const cell = (d, row, k) => {
      const rms = place.rms[row][k], floor = this.map.floor[d.axis];
      const ratio = rms !== null && floor > 0 ? rms / floor : null;
      const button = h("button", { type: "button", class: "cell", "data-row": row, "data-bin": k, "aria-label": `${d.word}, ${this.regime} ${number(place.edges[k])} to ${number(place.edges[k + 1])} ${place.unit}: ${ratio === null ? "no samples" : `${number(ratio, 2)} times the noise floor`}`,
        disabled: ratio === null, tabindex: row === 0 && k === 0 ? "0" : "-1", onclick: () => this.choose(d, k), onkeydown: (e) => move(e) }, ratio === null ? "–" : number(ratio, 2));
      // By powers: a residual of twice its floor is to be seen beside one of forty times.
      const strength = ratio === null || ratio <= 1 ? 0 : Math.min(Math.log(ratio) / Math.log(most), 1);
      button.style.setProperty("--heat", `${Math.round(100 * strength ** 1.4)}%`);
      return h("td", {}, button);
    };
    const move = (event) => {
      const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      if (!step) return;
      event.preventDefault();
      const next = this.grid.querySelector(`[data-row="${Number(event.target.dataset.row) + step[0]}"][data-bin="${Number(event.target.dataset.bin) + step[1]}"]`);
      if (next) { event.target.tabIndex = -1; next.tabIndex = 0; next.focus(); }
    };
    show(this.grid, h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": `Residual by ${this.regime}` }, h("table", { class: "heat" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, `${this.regime}, ${place.unit}`), Array.from({ length: bins }, (_, k) => h("th", { scope: "col" }, `${number(place.edges[k], 2)} – ${number(place.edges[k + 1], 2)}`)))),
      h("tbody", {}, DOF.map((d, row) => h("tr", {}, h("th", { scope: "row" }, `${d.axis} ${d.word}`), Array.from({ length: bins }, (_, k) => cell(d, row, k))))))));
    this.paint();
  }

  paint() {
    for (const button of this.element.querySelectorAll("[data-regime]")) button.setAttribute("aria-pressed", String(button.dataset.regime === this.regime));
    for (const button of this.element.querySelectorAll(".cell")) button.setAttribute("aria-pressed", String(Boolean(this.cell) && this.cell.regime === this.regime && Number(button.dataset.bin) === this.cell.bin && DOF[Number(button.dataset.row)].axis === this.dof.axis));
  }

  async choose(dof, bin) {
    const marks = await attempt(() => get("where-marks", { regime: this.regime, bin }));
    if (!marks) return;
    this.cell = { regime: this.regime, bin, marks };
    this.pick(dof);
    this.shade();
  }

  shade() { this.group.mark(this.cell ? (this.cell.marks.runs[String(this.run)] || []).map(([from, to]) => ({ from, to })) : []); }

  foot(state) {
    const done = state.answers.comparison;
    show(this.foot_,
      done.stale && h("p", { class: "soft" }, "This is the comparison of the earlier model."),
      h("button", { type: "button", class: done.stale ? "primary" : "", onclick: (e) => this.app.start("compare", [], e.target) }, "Compare again"),
      done.report && h("a", { href: "report/comparison", target: "_blank", rel: "noopener", class: "button" }, "Report"),
      h("button", { type: "button", class: done.stale ? "" : "primary", id: "diagnose", onclick: (e) => this.app.start("diagnose", [], e.target) }, state.answers.diagnosis && !state.answers.diagnosis.stale ? "Look again for what is missing" : "Find what is missing"));
  }

  repaint() { if (this.group) this.group.repaint(); }
  close() { if (this.group) this.group.destroy(); }
}
