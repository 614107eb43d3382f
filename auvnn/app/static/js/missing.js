// What is missing: the verdict, what is left without a name, what to drive next, and the candidates as cards.

import { attempt, get } from "./api.js";
import { interval } from "./charts.js";
import { card, chance, DOF, h, measured, number, percent, show } from "./dom.js";

const VERDICTS = {
  named: ["good", "The model lacks this"],
  ambiguous: ["warn", "One of these is missing, and this log cannot tell which"],
  partial: ["warn", "These predict what is missing; none of them is claimed as the cause"],
  unknown: ["bad", "Something is missing that nothing in the catalogue explains"],
  adequate: ["good", "Nothing is missing that this log could show"],
};

export class MissingScreen {
  constructor(app) {
    this.app = app;
    this.element = h("div", { class: "screen missing" });
    this.seen = "";
  }

  async update(state) {
    const done = state.answers.diagnosis;
    const key = JSON.stringify([done, state.history.length, Boolean(state.log)]);
    if (key === this.seen) return;
    this.seen = key;
    if (!done) { this.begin(state); return; }
    const found = await attempt(() => Promise.all([get("answer", { kind: "diagnosis" }), get("effects")]));
    if (!found) return;
    this.answer = found[0];
    this.effects = new Map(found[1].map((e) => [e.name, e]));
    this.draw(state, done);
  }

  begin(state) {
    const ready = state.log && state.log.ready && state.history.length;
    show(this.element, card("Not asked yet",
      h("p", {}, "A global test says whether anything is missing. Then each effect of the catalogue is fitted together with the uncertain coefficients, and kept only if free running improves on runs that were left out."),
      h("p", { class: "row" }, ready
        ? h("button", { type: "button", class: "primary", id: "diagnose", onclick: (e) => this.app.start("diagnose", [], e.target) }, "Find what is missing")
        : h("a", { href: "#log", class: "button" }, "Choose a log and a model first"))));
  }

  draw(state, done) {
    const answer = this.answer, missing = answer.missing || [];
    let [tone, words] = VERDICTS[answer.verdict] || ["warn", answer.verdict];
    if (answer.verdict === "named" && missing.some((n) => n in (answer.stated || {}))) words = missing.every((n) => n in answer.stated) ? "The model has this at other values" : "The model lacks this, or has it at other values";
    // Of a partial verdict nothing is named as the cause; what predicts a part stands first anyway.
    const named = missing.length ? missing : answer.verdict === "partial" ? answer.nearest || [] : [];
    const candidates = bestFirst(answer.candidates, [...named, ...(answer.nearest || [])]);
    const judged = candidates.filter((c) => !c.needs.length), others = candidates.filter((c) => c.needs.length);
    const first = judged.slice(0, Math.max(6, named.length)), rest = judged.slice(first.length);
    show(this.element,
      done.stale && h("p", { class: "note" }, "This is the diagnosis of the earlier model. ", h("button", { type: "button", class: "small", onclick: (e) => this.app.start("diagnose", [], e.target) }, "Look again")),
      h("section", { class: `verdict ${tone}`, "aria-label": "Verdict" },
        h("p", { class: "word" }, words, named.length ? ": " : ".", named.length > 0 && h("b", {}, named.join(answer.verdict === "ambiguous" ? " or " : ", "))),
        (answer.story || []).map((line) => h("p", {}, line.replaceAll(" +- ", " ± "))),
        this.next(named, done)),
      h("div", { class: "two tables" }, this.left(), this.costs(), this.drive()),
      answer.warnings.length > 0 && h("details", { class: "note" }, h("summary", {}, `${answer.warnings.length} ${answer.warnings.length === 1 ? "warning" : "warnings"}`), h("ul", {}, answer.warnings.map((w) => h("li", {}, w)))),
      h("h2", {}, "Candidates, best first"),
      h("div", { class: "cards" }, first.map((c) => this.candidate(c, named))),
      rest.length > 0 && h("details", { class: "card" }, h("summary", {}, h("h2", {}, `${rest.length} further candidates`)), h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Further candidates" }, this.table(rest))),
      others.length > 0 && h("details", { class: "card" }, h("summary", {}, h("h2", {}, `${others.length} that cannot be judged on this log or with this model`)),
        h("ul", {}, others.map((c) => h("li", {}, h("b", {}, c.effect), ` needs ${c.needs.join(", ")}`)))));
  }

  next(named, done) {
    return h("p", { class: "row" },
      named.length > 0 && h("button", { type: "button", class: "primary", id: "try", onclick: () => this.attempt(this.answer.verdict === "ambiguous" ? named.slice(0, 1) : named) }, `Try ${this.answer.verdict === "ambiguous" ? named[0] : named.join(", ")}`),
      done.report && h("a", { href: "report/diagnosis", target: "_blank", rel: "noopener", class: "button" }, "Report"));
  }

  attempt(names) {
    this.app.tried = {};
    for (const name of names) {
      const found = this.answer.candidates.find((c) => c.effect === name);
      const values = {};
      for (const [key, p] of Object.entries((found && found.parameters) || {})) if (Number.isFinite(p.value)) values[key] = p.value;
      this.app.tried[name] = values;
    }
    this.app.go("try");
  }

  // The force that has no name, in N and N m, where the answer states it.
  left() {
    const left = this.answer.left, depends = Object.entries(this.answer.depends_on || {});
    if (left && DOF.some((d) => left[d.axis])) {
      const force = (value, d) => (Number.isFinite(value) ? `${number(value, 2)} ${d.force}` : "–");
      const rows = DOF.filter((d) => left[d.axis]).map((d) => {
        const l = left[d.axis];
        return h("tr", {}, h("th", { scope: "row" }, `${d.axis} ${d.word}`), h("td", { class: "num" }, force(l.rms, d)), h("td", { class: "num" }, force(l.upper, d)), h("td", { class: "num" }, force(l.detectable, d)),
          h("td", { class: "num" }, Number.isFinite(l.correlation_time) ? `${number(l.correlation_time, 2)} s` : "–"), h("td", { class: "num" }, percent(l.share)));
      });
      return card("Left without a name",
        h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Force without a name" }, h("table", {}, h("thead", {}, h("tr", {}, ["", "rms", "at most", "smallest visible", "correlation time", "share"].map((w, k) => h("th", { scope: "col", class: k ? "num" : "" }, w)))), h("tbody", {}, rows))),
        h("p", { class: "soft" }, `Smallest visible: a force of this size would be found in 19 of 20 such logs. Share: of the actuators' force.${Number.isFinite(left.cost) ? ` The error on runs left out is ${percent(left.cost)} above the noise floor.` : ""}`));
    }
    return card("Left without a name",
      h("p", {}, this.answer.verdict === "adequate" ? "What is left looks like noise." : `${percent(this.answer.unexplained).replace("<", "Less than ")} of the residual's energy above the noise is explained by nothing in the catalogue.`),
      this.answer.acts_in && Object.keys(this.answer.acts_in).length > 0 && h("p", { class: "soft" }, `It acts in ${Object.keys(this.answer.acts_in).join(", ")}.`),
      (this.answer.nearest || []).length > 0 && h("p", { class: "soft" }, `Nearest, but not the cause: ${this.answer.nearest.join(", ")}.`),
      depends.length > 0 && h("p", { class: "soft" }, "It depends on: ", depends.map(([axis, shares]) => { const top = Object.entries(shares).sort((a, b) => b[1] - a[1])[0]; const group = top && ((this.answer.inseparable || {})[axis] || []).find((g) => g.includes(top[0])), alike = (group || []).filter((n) => n !== top[0]); return top ? `${axis} on ${top[0]}${alike.length ? `, which this log cannot tell from ${alike.join(" or ")}` : ""} (${percent(top[1])})` : null; }).filter(Boolean).join(", ")));
  }

  // What each name costs, and names that predict without being the cause, where the answer states them.
  costs() {
    const matters = Object.entries(this.answer.matters || {}), joint = Object.entries(this.answer.joint || {});
    if (!matters.length && !joint.length) return null;
    const gain = (g) => (g && Number.isFinite(g.value) ? measured(g.value, g.std, "1") : Number.isFinite(g) ? number(g) : "–");
    const names = (list) => (list || []).map((c) => (typeof c === "string" ? c : c.effect)).join(", ");
    return card(joint.length ? "What predicts a part" : "Does it matter?",
      matters.length > 0 && h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "What each name costs" }, h("table", {},
        h("thead", {}, h("tr", {}, ["effect", "matters", "costs", "force, of the actuators"].map((w, k) => h("th", { scope: "col", class: k > 1 ? "num" : "" }, w)))),
        h("tbody", {}, matters.map(([name, m]) => h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, m.matters === false ? "no" : "yes"), h("td", { class: "num" }, percent(m.cost)), h("td", { class: "num" }, percent(m.share))))))),
      matters.length > 0 && h("p", { class: "soft" }, "Costs: by how much the error on runs left out is larger without the name, everything else refitted."),
      joint.map(([name, j]) => h("div", {}, h("h3", {}, name), parameters(j.parameters),
        j.explained_by_dof && h("p", { class: "soft" }, "Explains of the force: ", DOF.filter((d) => Number.isFinite(j.explained_by_dof[d.axis])).map((d) => `${d.axis} ${percent(j.explained_by_dof[d.axis])}`).join(", ")),
        h("p", { class: "soft" }, `Lowers the error by ${gain(j.gain)}.`),
        (j.confounded_with || []).length > 0 && h("p", { class: "alike" }, `Cannot be told apart from ${names(j.confounded_with)}`))),
      joint.length > 0 && h("p", { class: "soft" }, "None of these names is claimed as the cause."));
  }

  drive() {
    const next = this.answer.next_experiment;
    if (!next) return null;
    return card("What to drive next", h("p", {}, next.words), Number.isFinite(next.standard_errors) && h("p", { class: "soft" }, `Expected to tell ${(next.separates || []).join(" and ")} apart by ${number(next.standard_errors, 2)} standard errors.`));
  }

  candidate(c, named) {
    const effect = this.effects.get(c.effect) || { cause: "", equation: "", sentence: "" };
    const chosen = named.includes(c.effect);
    const fall = Number.isFinite(c.cv_before) && Number.isFinite(c.cv_after) && c.cv_before > 0 ? 1 - c.cv_after / c.cv_before : null;
    return h("article", { class: `candidate ${chosen ? "chosen" : ""}`, "aria-label": c.effect },
      h("h3", {}, c.effect, chosen && h("span", { class: "badge good" }, this.answer.verdict === "partial" ? "predicts" : "named")),
      h("p", {}, capital(effect.cause), "."),
      h("details", { open: chosen }, h("summary", {}, "Equation and source"), h("p", {}, effect.sentence), effect.equation && h("pre", { tabindex: "0", "aria-label": `Equation of ${c.effect}` }, effect.equation), effect.reference && h("p", { class: "soft" }, effect.reference)),
      h("dl", { class: "evidence" },
        h("dt", {}, "explains"), h("dd", {}, meter(c.explained, `${percent(c.explained)} of the residual above the noise`), percent(c.explained)),
        h("dt", {}, "error on runs left out"), h("dd", {}, fall === null ? "unknown" : fall > 0.0005 ? `${percent(fall)} lower` : fall < -0.0005 ? `${percent(-fall)} higher` : "the same"),
        h("dt", {}, c.effect in (this.answer.stated || {}) ? "if it were as stated" : "if it were absent"), h("dd", {}, chance(c.p_value))),
      parameters(c.parameters, effect),
      (c.confusable_with || []).length > 0 && h("p", { class: "alike" }, "Looks alike on this log: ", c.confusable_with.slice(0, 4).map((o) => `${o.effect} (${number(o.similarity, 3)})`).join(", ")),
      h("p", {}, h("button", { type: "button", class: chosen ? "primary small" : "small", onclick: () => this.attempt([c.effect]) }, `Try ${c.effect}`)));
  }

  table(rows) {
    return h("table", {}, h("thead", {}, h("tr", {}, ["effect", "explains", "p", "error before", "after", "looks like", ""].map((w, k) => h("th", { scope: "col", class: k > 0 && k < 5 ? "num" : "" }, w || h("span", { class: "unseen" }, "action"))))),
      h("tbody", {}, rows.map((c) => h("tr", {}, h("th", { scope: "row" }, c.effect), h("td", { class: "num" }, percent(c.explained)), h("td", { class: "num" }, number(c.p_value, 2)), h("td", { class: "num" }, number(c.cv_before)), h("td", { class: "num" }, number(c.cv_after)),
        h("td", {}, c.confusable_with.slice(0, 2).map((o) => o.effect).join(", ")), h("td", {}, h("button", { type: "button", class: "small", "aria-label": `Try ${c.effect}`, onclick: () => this.attempt([c.effect]) }, "Try"))))));
  }

  close() {}
}

// As the report ranks them: what the verdict names, then what comes nearest, then by what each explains alone.
export function bestFirst(candidates, named) {
  const place = (c) => { const at = named.indexOf(c.effect); return at >= 0 ? at - 1000 : -(Number.isFinite(c.explained) ? c.explained : -1); };
  return [...candidates].sort((a, b) => place(a) - place(b));
}

function capital(text) { return text.slice(0, 1).toUpperCase() + text.slice(1); }

function meter(value, words) {
  const bar = h("span", {});
  bar.style.setProperty("width", `${100 * Math.min(Math.max(value || 0, 0), 1)}%`);
  return h("span", { class: "meter", role: "img", "aria-label": words }, bar);
}

export function parameters(values, effect) {
  const entries = Object.entries(values || {});
  if (!entries.length) return null;
  return h("table", { class: "parameters" },
    h("thead", { class: "unseen" }, h("tr", {}, ["parameter", "value", "interval of 95 %"].map((w) => h("th", { scope: "col" }, w)))),
    h("tbody", {}, entries.slice(0, 12).map(([name, p]) => {
      const known = effect && effect.parameters && effect.parameters.find((q) => q.name === name);
      const none = known ? known.null : 0;
      const reach = 1.15 * Math.max(Math.abs(p.value - none) + 2.5 * (p.std || 0), 1e-12);
      return h("tr", {}, h("th", { scope: "row" }, name), h("td", { class: "num" }, measured(p.value, p.std, p.unit)), h("td", {}, Number.isFinite(p.value) ? interval(p.value, p.std, none - reach, none + reach, none) : ""));
    })));
}
