// The result: before and after on data that no fit has seen, the history, and what to take home.

import { attempt, get, post } from "./api.js";
import { againstHorizon, waterfall } from "./charts.js";
import { card, choice, DOF, h, measured, number, percent, sentence, show } from "./dom.js";
import { parameters } from "./missing.js";
import { Group, key } from "./plot.js";

export class ResultScreen {
  constructor(app) {
    this.app = app;
    this.element = h("div", { class: "screen result" });
    this.seen = "";
    this.group = null;
    this.run = null;
  }

  async update(state) {
    const key_ = JSON.stringify([state.history, state.answers, state.saved, state.can_keep, state.can_keep_improved, Boolean(state.log && state.log.ready)]);
    if (key_ === this.seen) return;
    this.seen = key_;
    if (!(state.log && state.log.ready && state.history.length)) {
      show(this.element, card("Nothing to show yet", h("a", { href: "#log", class: "button" }, "Choose a log and a model first")));
      return;
    }
    const found = await attempt(() => Promise.all([state.answers.improvement ? get("answer", { kind: "improvement" }) : null, get("script"), state.answers.improve ? get("answer", { kind: "improve" }) : null]));
    if (!found) return;
    [this.answer, this.script, this.improved] = found;
    this.draw(state);
  }

  draw(state) {
    if (this.group) this.group.destroy();
    this.group = null;
    const answer = this.answer;
    show(this.element,
      answer ? this.story(state) : card("Nothing fitted yet", h("p", {}, "Fit an effect on the screen “Try it”; then the model is judged here on data that the fit has not seen."), h("p", {}, h("a", { href: "#try", class: "button" }, "Try it"))),
      answer && h("div", { class: "two" }, card("Held-out error at 5 s", waterfall(answer.waterfall)), this.horizons()),
      answer && this.traces(),
      answer && this.table(),
      this.loop(state),
      h("div", { class: "two" }, this.history(state), this.save(state)),
      this.scripts());
  }

  story(state) {
    const a = this.answer, falls = a.waterfall, first = falls[0].error, last = falls[falls.length - 2].error, floor = falls[falls.length - 1].error;
    return h("section", { class: `verdict ${a.accepted ? "good" : "warn"}`, "aria-label": "Result" },
      h("p", { class: "word" }, a.accepted ? "The held-out error falls" : "The held-out error does not fall by more than its own uncertainty", h("b", {}, `: ${number(first)} → ${number(last)}`), a.accepted && Number.isFinite(first) && first > 0 ? ` (${percent(1 - last / first)} lower)` : ""),
      h("p", {}, `With ${a.effects.join(", ")}; the noise floor is ${number(floor)}. ${sentence(a.more.held_out_words || "")}`),
      a.more.beaten && h("p", { class: "alike" }, sentence(a.more.beaten.replaceAll("`", ""))),
      h("p", { class: "row" },
        state.can_keep && h("button", { type: "button", class: "primary", id: "keep", onclick: (e) => attempt(async () => { await post("keep"); await this.app.changed(); }, e.target) }, "Keep it in the model"),
        state.answers.improvement.report && h("a", { href: "report/improvement", target: "_blank", rel: "noopener", class: "button" }, "Report")),
      a.warnings.length > 0 && h("details", {}, h("summary", {}, `${a.warnings.length} ${a.warnings.length === 1 ? "warning" : "warnings"}`), h("ul", {}, a.warnings.map((w) => h("li", {}, w)))));
  }

  // The whole loop by one button: what it took, step by step, and the error budget.
  loop(state) {
    const a = this.improved;
    const start = h("button", { type: "button", class: a ? "small" : "primary", id: "improve", onclick: (e) => this.app.start("improve", [], e.target) }, a ? "Walk it again" : "Improve");
    const about = h("p", { class: "soft" }, "Runs the whole loop without further clicks until nothing improves the model any more: refits, diagnoses, adds, learns what has no name. It takes minutes and can be stopped.");
    if (!a) return card("The whole loop", about, h("p", { class: "row" }, start));
    const improved = state.answers.improve;
    return card("The whole loop", h("p", { class: "word", id: "improved" }, a.verdict), waterfall(a.waterfall),
      a.steps.length > 0 && h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Steps of the loop" }, h("table", {},
        h("thead", {}, h("tr", {}, ["step", "what it is", "error on runs left out, before", "after", "fall"].map((w) => h("th", { scope: "col" }, w)))),
        h("tbody", {}, a.steps.map((step) => h("tr", {}, h("th", { scope: "row" }, step.step), h("td", {}, step.kind), h("td", { class: "num" }, number(step.before)), h("td", { class: "num" }, number(step.after)), h("td", { class: "num" }, step.gain && Number.isFinite(step.gain.value) ? measured(step.gain.value, step.gain.std, "1") : "–")))))),
      Object.entries(a.loses || {}).filter(([, names]) => names.length > 0).map(([what, names]) => h("p", { class: "alike" }, `Worse than ${what === "baseline" ? "the plain regression" : "holding the speed"} in ${names.join(", ")}.`)),
      h("details", {}, h("summary", {}, "How it went"), h("ol", {}, (a.story || []).map((line) => h("li", {}, line))), (a.tried || []).length > 0 && h("p", { class: "soft" }, `Tried and not taken: ${a.tried.map((t) => t.step).join(", ")}.`)),
      (a.warnings || []).length > 0 && h("details", {}, h("summary", {}, `${a.warnings.length} ${a.warnings.length === 1 ? "warning" : "warnings"}`), h("ul", {}, a.warnings.map((w) => h("li", {}, w)))),
      h("p", { class: "row" },
        state.can_keep_improved && h("button", { type: "button", class: "primary", id: "keep-improved", onclick: (e) => attempt(async () => { await post("keep", { kind: "improve" }); await this.app.changed(); }, e.target) }, "Keep it in the model"),
        improved && improved.report && h("a", { href: "report/improve", target: "_blank", rel: "noopener", class: "button" }, "Report"), start),
      about);
  }

  horizons() {
    const a = this.answer, of = (part) => Object.fromEntries(Object.entries(part.rollout).map(([k, v]) => [k, v.total]));
    const persistence = Object.fromEntries(Object.entries(a.before.rollout).map(([k, v]) => [k, v.persistence]));
    const floor = Object.fromEntries(Object.entries(a.after.rollout).map(([k, v]) => [k, v.noise_floor]));
    const rows = [["given", "as given", of(a.before)], ["refitted", "coefficients refitted", of(a.refitted)], ["after", `with ${a.effects.join(", ")}`, of(a.after)], ["persistence", "holding the speed", persistence], ["floor", "noise floor", floor]];
    return card("Held-out error against horizon", againstHorizon(rows), key(...rows.map(([kind, words]) => [kind, words])));
  }

  traces() {
    this.group = new Group(async (from, to, points) => {
      const found = await get("held-traces", { run: this.run, from, to, points });
      if (this.run === null) this.run = found.run;
      if (found.runs.length > 1 && !this.chooser.firstChild) show(this.chooser, choice("Run", found.runs.map((r) => [r, r]), this.run, (v) => { this.run = Number(v); this.group.zoom(null); }));
      return found;
    });
    this.chooser = h("span", {});
    const group = this.group;
    const plots = DOF.map((d) => group.add({ title: `${d.velocity}, ${d.word}`, label: `${d.word} velocity ${d.velocity} on held-out data: measured, before, after`, unit: d.unit, height: 132, named: false,
        series: [{ key: `${d.velocity}_before`, label: "as given", look: "given" }, { key: `${d.velocity}_after`, label: "after", look: "after" }, { key: d.velocity, label: "measured", look: "measured" }] }));
    requestAnimationFrame(() => attempt(() => group.refresh()));
    return card("Held-out data: before and after", h("div", { class: "row spread" }, this.chooser, group.controls()), key(["measured", "measured"], ["given", "as given"], ["after", "after"]), h("div", { class: "plots" }, plots));
  }

  table() {
    const a = this.answer, five = a.after.rollout["5"] && Number.isFinite(a.after.rollout["5"].total) ? "5" : Object.keys(a.after.rollout).find((k) => Number.isFinite(a.after.rollout[k].total));
    if (!five) return null;
    const cell = (part, name) => h("td", { class: "num" }, number(part.rollout[five][name].rmse));
    return card(`Error of ${five === "full" ? "the whole run" : `${five} s`} free running, by velocity`, h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Errors by velocity" }, h("table", {},
      h("thead", {}, h("tr", {}, ["", ...DOF.map((d) => `${d.velocity}, ${d.unit}`)].map((w, k) => h("th", { scope: "col", class: k ? "num" : "" }, w)))),
      h("tbody", {}, [["as given", a.before], ["coefficients refitted", a.refitted], ["after", a.after]].map(([words, part]) => h("tr", {}, h("th", { scope: "row" }, words), DOF.map((d) => cell(part, d.velocity))))))),
    h("h3", {}, "Fitted values"), Object.entries(a.parameters).map(([name, values]) => h("div", {}, h("h4", {}, name), parameters(values))));
  }

  history(state) {
    return card("History of the model", h("ol", { class: "history" }, state.history.map((step, k) => h("li", {}, h("b", {}, k === 0 ? step.source.split("/").pop() : step.words), k === 0 ? " as given" : "",
      Number.isFinite(step.error.after) && h("span", { class: "soft" }, ` held-out error ${number(step.error.before)} → ${number(step.error.after)}`)))),
    state.taken_back.length > 0 && h("p", { class: "soft" }, `Taken back: ${state.taken_back.join(", ")}`),
    state.history.length > 1 && h("p", { class: "row" }, h("button", { type: "button", onclick: (e) => attempt(async () => { await post("take-back"); await this.app.changed(); }, e.target) }, "Take back the last"),
      h("button", { type: "button", onclick: (e) => this.app.start("diagnose", [], e.target) }, "Look for what else is missing")));
  }

  save(state) {
    const folder = h("input", { type: "text", id: "folder", value: this.script.folder, spellcheck: "false", autocomplete: "off" });
    const told = h("div", { id: "told" }, state.saved.map((path) => h("p", { class: "good" }, `Saved: ${path}`)), state.saved_without.map((words) => h("p", { class: "bad" }, `But ${words}.`)));
    const kept = state.history.length > 1;
    return card("Save",
      h("form", { onsubmit: (event) => { event.preventDefault(); event.submitter.textContent = "Saving …"; attempt(async () => { await post("save", { folder: folder.value }); await this.app.changed(); }, event.submitter).finally(() => { event.submitter.textContent = "Save"; }); } },
        h("label", { for: "folder" }, "Folder on this machine, new or empty"), folder,
        h("p", { class: "soft" }, `Holds ${kept ? "the model, " : ""}the logs, the answers with their reports, and the commands and the script below.`, kept ? "" : " No effect was kept yet: without a model."),
        h("p", { class: "row" }, h("button", { type: "submit", class: "primary", id: "save" }, "Save"))),
      told);
  }

  scripts() {
    const block = (title, text) => h("div", {}, h("div", { class: "row spread" }, h("h3", {}, title), h("button", { type: "button", class: "small", onclick: (e) => copy(text, e.target) }, "Copy")), h("pre", { tabindex: "0", "aria-label": title }, text));
    return h("details", { class: "card", open: true }, h("summary", {}, h("h2", {}, "The same without the page")), h("div", { class: "two" }, block("Commands", this.script.commands), block("Python", this.script.python)));
  }

  repaint() { if (this.group) this.group.repaint(); }
  close() { if (this.group) this.group.destroy(); }
}

async function copy(text, button) {
  const words = button.textContent;
  try { await navigator.clipboard.writeText(text); button.textContent = "Copied"; } catch { button.textContent = "Select and copy it by hand"; }
  setTimeout(() => { button.textContent = words; }, 1500);
}
