// Try it: effects on and off, values by sliders, the free run follows; Fit, and the held-out error falls.

import { attempt, complain, get, post } from "./api.js";
import { waterfall } from "./charts.js";
import { card, choice, DOF, duration, h, measured, number, percent, sentence, show } from "./dom.js";
import { bestFirst, parameters } from "./missing.js";
import { Group, key } from "./plot.js";

export class TryScreen {
  constructor(app) {
    this.app = app;
    this.element = h("div", { class: "screen try" });
    this.seen = "";
    this.run = null;
    this.horizon = "full";
    this.group = null;
    this.pending = false;
    this.again = false;
  }

  async update(state) {
    const key_ = JSON.stringify([state.log && state.log.name, state.log && state.log.ready, state.history, state.answers.improvement, state.can_keep]);
    if (key_ === this.seen) return;
    const model = JSON.stringify([state.log && state.log.name, state.history.map((s) => s.words)]);
    this.seen = key_;
    this.state = state;
    if (!(state.log && state.log.ready && state.history.length)) {
      show(this.element, card("Nothing to try yet", h("a", { href: "#log", class: "button" }, "Choose a log and a model first")));
      return;
    }
    const fitted = state.answers.improvement ? await attempt(() => get("answer", { kind: "improvement" })) : null;
    this.fitted = fitted;
    if (this.model === model && this.effects) { this.outcome(); return; }
    const found = await attempt(() => Promise.all([get("effects"), get("log"), state.answers.diagnosis ? get("answer", { kind: "diagnosis" }) : null]));
    if (!found) return;
    this.model = model;
    [this.effects, this.log, this.diagnosis] = found;
    // Of an earlier model's diagnosis it is not known what the log says of this model's values.
    this.other = (this.diagnosis && !state.answers.diagnosis.stale && this.diagnosis.stated) || {};
    this.draw();
  }

  draw() {
    const candidates = new Map(((this.diagnosis && this.diagnosis.candidates) || []).map((c) => [c.effect, c]));
    this.entries = this.effects.map((effect) => {
      const seen = candidates.get(effect.name), own = this.app.tried[effect.name];
      const values = {};
      for (const p of effect.parameters) {
        const guess = seen && seen.parameters && seen.parameters[p.name];
        values[p.name] = own && Number.isFinite(own[p.name]) ? own[p.name] : effect.present ? p.value : guess && Number.isFinite(guess.value) ? guess.value : p.null;
      }
      return { effect, seen, values, on: effect.present || Boolean(own) };
    });
    const runs = this.log.fit_runs;
    if (this.run === null || !runs.some((r) => r.number === this.run)) this.run = runs[0].number;
    this.list = h("div", { class: "effects" });
    this.meter = h("div", { class: "gauges", role: "status" });
    this.fitPlace = h("div", { class: "stack" });
    if (this.group) this.group.destroy();
    this.group = new Group((from, to, points) => this.whole(from, to, points));
    const group = this.group;
    const plots = DOF.map((d) => group.add({ title: [`${d.velocity}, ${d.word}`, h("span", { class: "soft", "data-error": d.velocity })], label: `${d.word} velocity ${d.velocity}: measured, as it stands, and with these effects`, unit: d.unit, height: 132, named: false,
        series: [{ key: `${d.velocity}0`, label: "as it stands", look: "given" }, { key: `${d.velocity}1`, label: "tried", look: "after" }, { key: d.velocity, label: "measured", look: "measured" }] }));
    show(this.element,
      h("div", { class: "two try" },
        h("div", { class: "stack" }, card("Effects", this.list, h("div", { class: "next left" },
          h("button", { type: "button", class: "primary", id: "fit", onclick: (e) => this.fit(e.target) }, "Fit"),
          h("p", { class: "soft" }, "Fit finds the values with the uncertain coefficients, and judges by the held-out data."))), this.fitPlace),
        h("div", { class: "stack" }, this.meter,
          card("Free run", h("div", { class: "row spread" },
            h("div", { class: "row" }, runs.length > 1 ? choice("Run", runs.map((r) => [r.number, `${r.number} (${duration(r.end - r.begin)})`]), this.run, (v) => { this.run = Number(v); group.zoom(null); }) : null,
              choice("Starts again", [["full", "never"], ["30", "every 30 s"], ["5", "every 5 s"]], this.horizon, (v) => { this.horizon = v; attempt(() => group.refresh()); })),
            group.controls()),
            key(["measured", "measured"], ["given", "model as it stands"], ["after", "with these effects"]),
            h("div", { class: "plots" }, plots)))));
    this.toggles();
    this.outcome();
    requestAnimationFrame(() => attempt(() => group.refresh()));
  }

  chosen() { return this.entries.filter((e) => e.on); }

  toggles() {
    const first = this.entries.filter((e) => e.on || e.effect.present || (this.diagnosis && (this.diagnosis.missing || []).includes(e.effect.name)));
    const likely = this.diagnosis ? bestFirst(this.diagnosis.candidates, this.diagnosis.nearest || []).filter((c) => !c.needs.length && !first.some((e) => e.effect.name === c.effect)).slice(0, 4).map((c) => this.entries.find((e) => e.effect.name === c.effect)).filter(Boolean) : [];
    const top = [...first, ...likely], others = this.entries.filter((e) => !top.includes(e));
    const opened = this.list.querySelector("details[open]") !== null;
    show(this.list, top.map((e) => this.entry(e)),
      h("details", { open: opened || top.length === 0 }, h("summary", {}, `${others.length} other effects`), others.map((e) => this.entry(e))));
  }

  entry(entry) {
    const effect = entry.effect, id = `on-${effect.name}`, lacks = effect.lacks.length > 0;
    return h("div", { class: `effect ${entry.on ? "on" : ""}` },
      h("div", { class: "row" },
        h("input", { type: "checkbox", role: "switch", class: "switch", id, checked: entry.on, disabled: lacks, onchange: (e) => { entry.on = e.target.checked; this.toggles(); const again = document.getElementById(id); if (again) again.focus(); this.follow(); } }),
        h("label", { for: id }, h("b", {}, effect.name), h("span", { class: "soft" }, ` ${effect.cause}`)),
        effect.present && h("span", { class: "badge" }, effect.name in this.other ? "in the model, at other values than the log" : "in the model")),
      lacks && h("p", { class: "soft" }, `needs ${effect.lacks.join(", ")}`),
      entry.on && effect.parameters.map((p) => this.slider(entry, p)));
  }

  slider(entry, p) {
    const guess = entry.seen && entry.seen.parameters && entry.seen.parameters[p.name];
    const fitted = this.fitted && this.fitted.parameters[entry.effect.name] && this.fitted.parameters[entry.effect.name][p.name];
    const known = fitted || guess, value = entry.values[p.name];
    // What is plausible around the null, and what the log says about it where it says anything.
    const reach = Math.max(3 * p.scale, Math.abs((known && known.value) - p.null) * 1.5 || 0, Math.abs(value - p.null) * 1.2);
    const low = Math.max(p.low, p.null - reach), high = Math.min(p.high, p.null + reach);
    const step = (high - low) / 1000;
    const id = `${entry.effect.name}-${p.name}`;
    const shown = h("input", { type: "number", step: "any", class: "narrow", "aria-label": `${p.name} of ${entry.effect.name}, ${p.unit === "1" ? "a pure number" : p.unit}`, value: Number(value.toPrecision(4)) });
    const range = h("input", { type: "range", id, min: low, max: high, step, value, "data-effect": entry.effect.name, "data-parameter": p.name, "aria-valuetext": `${number(value, 4)} ${p.unit === "1" ? "" : p.unit}` });
    const set = (v) => {
      const now = Math.min(Math.max(v, p.low), p.high);
      entry.values[p.name] = now;
      range.setAttribute("aria-valuetext", `${number(now, 4)} ${p.unit === "1" ? "" : p.unit}`);
      this.follow();
    };
    range.addEventListener("input", () => { set(range.valueAsNumber); shown.value = Number(range.valueAsNumber.toPrecision(4)); });
    shown.addEventListener("change", () => { if (Number.isFinite(shown.valueAsNumber)) { set(shown.valueAsNumber); range.value = entry.values[p.name]; } });
    const back = known && Number.isFinite(known.value) && h("button", { type: "button", class: "link small", onclick: () => { range.value = known.value; set(known.value); shown.value = Number(known.value.toPrecision(4)); } }, `${fitted ? "fitted" : "estimate"} ${measured(known.value, known.std, p.unit)}`);
    return h("div", { class: "slider" },
      h("label", { for: id }, p.name, h("span", { class: "soft" }, p.unit === "1" ? "" : ` ${p.unit}`)), range, shown,
      h("p", { class: "soft" }, back || `${number(low)} to ${number(high)}`));
  }

  asked(more) {
    return { effects: Object.fromEntries(this.chosen().map((e) => [e.effect.name, e.values])), horizon: this.horizon, run: this.run, ...more };
  }

  // What was measured, the model as it stands, and the free run with these effects, over what is in view.
  async whole(from, to, points) {
    this.view = null;
    const view = { from, to, points };
    const found = await post("try", this.asked(view));
    this.view = view;
    this.base = found.traces.series;
    this.gauge(found);
    return found.traces;
  }

  // One free run at a time; while one is under way only the last wish is remembered.
  async follow() {
    if (this.pending) { this.again = true; return; }
    this.pending = true;
    try {
      do {
        this.again = false;
        await this.redraw();
      } while (this.again);
    } catch (error) {
      complain(error);
    } finally {
      this.pending = false;
    }
  }

  // The same view at the same times: only what was tried is asked for again.
  async redraw() {
    const view = this.view;
    if (!view) return;
    const began = performance.now();
    const found = await post("try", this.asked({ ...view, whole: false, judge: false }));
    if (view !== this.view) return;
    this.base = { ...this.base, ...found.traces.series };
    this.group.set({ t: found.traces.t, series: this.base });
    document.dispatchEvent(new CustomEvent("redrawn", { detail: performance.now() - began }));
    this.judge();
  }

  // The error follows when the slider rests: working it out takes as long as the traces.
  judge() {
    clearTimeout(this.judging);
    const view = this.view;
    this.judging = setTimeout(() => attempt(async () => {
      const found = await post("try", this.asked({ ...view, points: 16, whole: false }));
      if (view === this.view) this.gauge(found);
    }), 60);
  }

  gauge(found) {
    const box = (value, words, kind) => h("div", { class: `figure ${kind || ""}` }, h("p", { class: "value" }, number(value)), h("p", { class: "soft" }, words));
    const given = found.given.total, now = found.error.total;
    const change = Number.isFinite(given) && Number.isFinite(now) && given > 0 ? now / given - 1 : null;
    show(this.meter, h("div", { class: "figures" },
      box(given, `model as it stands, error at ${found.horizon === "full" ? "the whole run" : `${found.horizon} s`}`),
      box(now, change === null || Math.abs(change) < 0.0005 ? "with these effects: the same" : `with these effects: ${percent(Math.abs(change))} ${change < 0 ? "lower" : "higher"}`, change !== null && change < -0.02 ? "good" : change > 0.02 ? "bad" : ""),
      box(found.error.persistence, "holding the speed")),
    found.diverged > 0 && h("p", { class: "bad" }, `${found.diverged} free ${found.diverged === 1 ? "run" : "runs"} diverged`));
    for (const d of DOF) {
      const place = this.element.querySelector(`[data-error="${d.velocity}"]`);
      if (place) place.textContent = ` ${number(found.given[d.velocity], 2)} → ${number(found.error[d.velocity], 2)}`;
    }
  }

  fit(button) {
    // Of those that the model has, such as the log contradicts are fitted anew.
    const fresh = this.chosen().filter((e) => !e.effect.present || (e.effect.name in this.other && e.effect.name in this.app.tried)).map((e) => e.effect.name);
    this.app.start("add", fresh, button);
  }

  outcome() {
    const state = this.app.state, found = this.fitted;
    if (!found) { show(this.fitPlace, state.history.length > 1 ? this.backCard(state) : null); return; }
    const gain = found.gain;
    show(this.fitPlace, card(`Held-out error: ${found.effects.join(", ")}`,
      waterfall(found.waterfall),
      h("p", { class: found.accepted ? "good" : "bad" }, found.accepted ? `Accepted: the error falls by ${measured(gain.value, gain.std, "1")} from the refitted model.` : "Not accepted: the held-out error does not fall by more than its own uncertainty."),
      found.more && found.more.beaten && h("p", { class: "bad" }, sentence(found.more.beaten.replaceAll("`", ""))),
      Object.entries(found.parameters).map(([name, values]) => h("div", {}, h("h3", {}, name), parameters(values, this.effects && this.effects.find((e) => e.name === name)))),
      found.warnings.length > 0 && h("details", {}, h("summary", {}, `${found.warnings.length} ${found.warnings.length === 1 ? "warning" : "warnings"}`), h("ul", {}, found.warnings.map((w) => h("li", {}, w)))),
      h("p", { class: "row" },
        state.can_keep && h("button", { type: "button", class: "primary", id: "keep", onclick: (e) => this.keep(e.target) }, "Keep it in the model"),
        !state.can_keep && h("span", { class: "soft" }, "This fit is in the model."),
        this.back(state))));
  }

  backCard(state) { return card("History", h("p", {}, state.history.map((s) => s.words).join(" → ")), h("p", { class: "row" }, this.back(state))); }

  back(state) {
    return state.history.length > 1 && h("button", { type: "button", id: "back", onclick: (e) => attempt(async () => { this.app.tried = {}; await post("take-back"); await this.app.changed(); }, e.target) }, "Take back");
  }

  keep(button) {
    attempt(async () => {
      await post("keep");
      this.app.tried = {};
      await this.app.changed();
      this.app.go("result");
    }, button);
  }

  repaint() { if (this.group) this.group.repaint(); }

  close() {
    if (this.group) this.group.destroy();
    if (this.entries) { const before = this.app.tried; this.app.tried = {}; for (const e of this.chosen()) if (!e.effect.present || e.effect.name in before) this.app.tried[e.effect.name] = { ...e.values }; }
  }
}
