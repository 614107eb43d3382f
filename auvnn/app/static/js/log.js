// The log: drop a file, see what was read, correct units and frames, and hear what the check objects to.

import { attempt, get, post, upload } from "./api.js";
import { card, choice, duration, h, number, plural, s, show } from "./dom.js";
import { Group, SEVERAL } from "./plot.js";

const TITLES = { velocity: "Velocity", rates: "Angular rate", attitude: "Attitude", position: "Position (NED)", commands: "Commands", fins: "Fins", altitude: "Height above the bottom", voltage: "Battery" };
const UNITS = { velocity: "m/s", rates: "rad/s", attitude: "rad", position: "m", commands: "", fins: "rad", altitude: "m", voltage: "V" };
const ORDER = ["error", "warning", "repair", "info"];

export class LogScreen {
  constructor(app) {
    this.app = app;
    this.element = h("div", { class: "screen log" });
    this.seen = "";
    this.run = null;
    this.group = null;
  }

  async update(state) {
    this.state = state;
    const key = JSON.stringify([state.log, state.reading, state.history[0], state.answers.comparison ? 1 : 0]);
    if (key === this.seen) return;
    this.seen = key;
    if (state.reading) { show(this.element, card("Reading", h("p", {}, `${state.reading} is being read …`))); return; }
    if (!state.log) { this.begin(); return; }
    const log = await attempt(() => get("log"));
    if (!log) return;
    const findings = state.log.judged ? await get("findings") : null;
    this.draw(state, log, findings);
  }

  async drop(file, use = "log") { await attempt(async () => this.app.changed(await upload(file, use))); }

  chooser(id, words, use, accept) {
    const input = h("input", { type: "file", id, class: "unseen-file", accept, onchange: (e) => e.target.files[0] && this.drop(e.target.files[0], use) });
    return h("span", { class: "file" }, input, h("label", { for: id, class: "button" }, words));
  }

  begin() {
    const path = h("input", { type: "text", id: "path", placeholder: "~/dives/dive.parquet", spellcheck: "false", autocomplete: "off" });
    const open = (event) => { event.preventDefault(); attempt(async () => this.app.changed(await post("open", { path: path.value }))); };
    show(this.element,
      h("p", { class: "lead" }, "auvnn compares a vehicle's model with its log, says where the model is wrong and which physical effect is missing, and adds it. It begins with a log."),
      h("div", { class: "drop", id: "drop" },
        h("p", { class: "big" }, "Drop a log here"),
        h("p", { class: "row centre" }, this.chooser("file", "Choose a file", "log"), h("span", { class: "soft" }, "or"),
          h("button", { type: "button", id: "example", onclick: (e) => this.app.start("example", [], e.target) }, "Use an example with a hidden current")),
        h("form", { class: "row centre", onsubmit: open }, h("label", { for: "path" }, "or a path on this machine"), path, h("button", { type: "submit", class: "small" }, "Open"))),
      h("p", { class: "soft" }, "CSV and Parquet, and the formats that your installation reads. Columns, units and frames can be set once the file is read. Nothing leaves this machine."));
  }

  draw(state, log, findings) {
    if (this.group) this.group.destroy();
    this.group = null;
    const broken = !log.overview;
    show(this.element,
      this.head(state, log),
      broken ? this.trouble(log) : h("div", { class: "two wide-left" }, this.traces(log), h("div", { class: "stack" }, this.checked(findings, state), this.heldOut(log))),
      this.columns(log),
      !broken && this.next(state));
  }

  head(state, log) {
    const seen = log.overview;
    const facts = seen ? [
      plural(seen.runs.length, "run"), plural(seen.samples, "sample"), duration(seen.duration), `${number(seen.rate)} Hz`, `driven by ${seen.kind === "wrench" ? "a wrench" : seen.kind}`,
    ] : [];
    return h("div", { class: "head" },
      h("div", {}, h("p", { class: "name" }, state.log.name), h("p", { class: "soft" }, facts.join(" · "))),
      h("div", { class: "row" }, this.chooser("file", "Another file", "log"), this.model(state)));
  }

  model(state) {
    const now = state.history.length ? state.history[0].source : "";
    const holder = h("span", { class: "row" });
    get("vehicles").then((names) => {
      const options = [["", "choose …"], ...names.map((n) => [n, n])];
      if (now && !names.includes(now)) options.push([now, now.split("/").pop()]);
      show(holder,
        choice("Model", options, now, (source) => source && attempt(async () => this.app.changed(await post("model", { source })))),
        this.chooser("yaml", "Your own (YAML)", "model", ".yaml,.yml"));
      holder.querySelector("select").id = "model";
    }).catch(() => {});
    return holder;
  }

  trouble(log) {
    return card("This file cannot be read as a log yet",
      h("p", { class: "bad" }, log.error),
      log.offered && h("p", {}, h("button", { type: "button", class: "primary", id: "offered", onclick: () => this.map(log.offered) }, "Read it so")),
      h("p", { class: "soft" }, "Below, each channel can be taken from a column of the file."));
  }

  traces(log) {
    const runs = log.overview.runs;
    if (this.run === null || !runs.some((r) => r.number === this.run)) this.run = runs[0].number;
    const groups = Object.entries(log.overview.groups).filter(([, names]) => names.length);
    this.group = new Group(async (from, to, points) => {
      const parts = await Promise.all(groups.map(([group]) => get("traces", { group, run: this.run, from, to, points })));
      return { t: parts[0].t, series: Object.assign({}, ...parts.map((p) => p.series)) };
    });
    const group = this.group;
    const plots = groups.map(([name, names]) => group.add({
      title: [TITLES[name], name === "commands" ? h("span", { class: "soft" }, log.overview.kind === "wrench" ? " N, N m" : " −1 to 1") : ""],
      label: `${TITLES[name]} over time: ${names.join(", ")}`, unit: UNITS[name], height: 124,
      series: names.slice(0, 8).map((n, k) => ({ key: n, label: n.replace("thruster_", "T").replace("tau_", ""), look: SEVERAL[k] })),
    }));
    const element = card("Traces",
      h("div", { class: "row spread" },
        runs.length > 1 ? choice("Run", runs.map((r) => [r.number, `${r.number} (${duration(r.end - r.begin)})`]), this.run, (value) => { this.run = Number(value); group.mark([]); group.zoom(null); }) : h("span", {}),
        group.controls()),
      plots, h("p", { class: "soft" }, "Drag over a plot to zoom in; double-click shows all."));
    requestAnimationFrame(() => attempt(() => group.refresh()));
    return element;
  }

  // What a finding speaks of, shown on the time axis.
  async place(finding) {
    const first = finding.marks[0];
    if (first.run !== this.run) { this.run = first.run; const select = this.element.querySelector(".card select"); if (select) select.value = String(first.run); }
    this.group.mark(finding.marks.filter((m) => m.run === this.run));
    const width = Math.max(20 * (first.to - first.from), 2);
    this.group.range = null;
    await this.group.refresh();
    if (first.to - first.from < 0.5 * (this.group.extent[1] - this.group.extent[0])) await this.group.zoom([first.from - width, first.to + width]);
  }

  checked(findings, state) {
    if (!findings) return card("Check", h("p", { class: "soft" }, "The log is being checked …"));
    if (!findings.length) return card("Check", h("p", { class: "good" }, "Nothing to object: signs, units, axes, time stamps and excitation agree."));
    const shown = [...findings].sort((a, b) => ORDER.indexOf(a.level) - ORDER.indexOf(b.level));
    return card(`Check: ${plural(findings.length, "finding")}`, h("ul", { class: "findings" }, shown.map((f) => h("li", { class: f.level },
      h("p", {}, h("span", { class: `badge ${f.level}` }, f.level), h("b", {}, f.where), " ", f.what),
      f.cure && h("p", { class: "soft" }, f.cure),
      h("p", { class: "row" },
        f.buttons.map((b) => h("button", { type: "button", class: "small", onclick: (e) => this.cure(b, e.target) }, b.label)),
        f.marks.length > 0 && h("button", { type: "button", class: "small quiet", onclick: () => attempt(() => this.place(f)) }, "Show on the time axis"))))));
  }

  cure(button, target) {
    if (button.effect) { this.app.tried[button.effect] = this.app.tried[button.effect] || {}; this.app.go("try"); return; }
    attempt(async () => this.app.changed(await post("mapping", { change: button.change })), target);
  }

  map(mapping) { return attempt(async () => this.app.changed(await post("mapping", { mapping }))); }

  heldOut(log) {
    return card("Held out", h("p", {}, log.held_words),
      h("p", { class: "soft" }, "Fits never see it; the result is judged by it."),
      h("p", { class: "row" }, this.chooser("test", "Hold out another file", "held")));
  }

  columns(log) {
    const mapping = structuredClone(log.mapping);
    mapping.columns = mapping.columns || {};
    mapping.frame = mapping.frame || {};
    const send = () => {
      const clean = structuredClone(mapping);
      if (!Object.keys(clean.columns).length) delete clean.columns;
      if (!Object.keys(clean.frame).length) delete clean.frame;
      this.map(clean);
    };
    const set = (key) => (value) => { mapping[key] = value; send(); };
    const units = h("div", { class: "row units" },
      choice("Body frame", [["FRD", "FRD"], ["FLU", "FLU"]], mapping.frame.body || "FRD", (v) => { mapping.frame.body = v; send(); }),
      choice("World frame", [["NED", "NED"], ["ENU", "ENU"]], mapping.frame.world || "NED", (v) => { mapping.frame.world = v; send(); }),
      choice("Angles", [["rad", "rad"], ["deg", "deg"]], mapping.angles || "rad", set("angles")),
      choice("Rates", [["rad", "rad/s"], ["deg", "deg/s"]], mapping.rates || "rad", set("rates")),
      choice("Quaternion", [["wxyz", "w x y z"], ["xyzw", "x y z w"]], mapping.quaternion || "wxyz", set("quaternion")),
      choice("Time", [["s", "s"], ["ms", "ms"], ["us", "µs"], ["ns", "ns"]], (mapping.time && mapping.time.unit) || "s", (v) => { mapping.time = { unit: v }; send(); }));
    const there = new Map(log.columns.map((c) => [c.name, c]));
    const raw = log.raw.map((c) => c.name);
    const wanted = ["t", "u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "qw", "qx", "qy", "qz", "x", "y", "z"];
    const missing = log.overview ? Object.keys(log.guesses).filter((n) => !there.has(n)) : wanted.filter((n) => !there.has(n));
    const names = [...there.keys(), ...missing];
    const rows = names.map((name) => this.row(name, there.get(name), raw, log, mapping, send));
    return h("details", { class: "card", open: !log.overview }, h("summary", {}, h("h2", {}, "Columns, units and frames")),
      units,
      h("p", { class: "soft" }, "What is set here is what the log has; auvnn turns it into SI units, NED and FRD."),
      h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Columns" }, h("table", {},
        h("thead", {}, h("tr", {}, ["channel", "from the file's column", "times", "plus", "unit", "smallest", "largest", "missing", "preview"].map((w) => h("th", { scope: "col" }, w)))),
        h("tbody", {}, rows))),
      log.unknown.length > 0 && h("p", { class: "soft" }, `Kept but not used: ${log.unknown.join(", ")}`));
  }

  row(name, seen, raw, log, mapping, send) {
    const own = mapping.columns[name] || {};
    const edit = (change) => {
      const column = { from: own.from || name, ...mapping.columns[name], ...change };
      if (column.scale === 1) delete column.scale;
      if (column.offset === 0) delete column.offset;
      mapping.columns[name] = column;
      if (column.from === name && Object.keys(column).length === 1) delete mapping.columns[name];
      send();
    };
    const options = [["", "–"], ...raw.map((n) => [n, n])];
    const now = own.from !== undefined ? own.from : raw.includes(name) ? name : "";
    if (now && typeof now === "string" && !raw.includes(now)) options.push([now, now]);
    const field = (label, value, key) => h("input", { type: "number", step: "any", class: "narrow", "aria-label": `${label} for ${name}`, value: value ?? "", disabled: !seen,
      onchange: (e) => Number.isFinite(e.target.valueAsNumber) && edit({ [key]: e.target.valueAsNumber }) });
    const hint = !seen && log.guesses[name];
    return h("tr", { class: seen ? null : "absent" }, h("th", { scope: "row" }, name),
      h("td", {}, h("select", { "aria-label": `Column for ${name}`, value: typeof now === "string" ? now : "", onchange: (e) => { if (e.target.value) edit({ from: e.target.value }); else { delete mapping.columns[name]; send(); } } },
        options.map(([v, w]) => h("option", { value: v }, w))), hint && h("span", { class: "soft" }, ` ${hint}?`)),
      h("td", {}, field("Factor", seen && seen.scale, "scale")), h("td", {}, field("Offset", seen && seen.offset, "offset")),
      h("td", {}, seen ? (seen.unit === "1" ? "" : seen.unit) : ""), h("td", { class: "num" }, seen ? number(seen.low) : ""), h("td", { class: "num" }, seen ? number(seen.high) : ""),
      h("td", { class: "num" }, seen && seen.missing ? seen.missing.toLocaleString("en") : ""), h("td", {}, seen ? spark(seen.spark) : ""));
  }

  next(state) {
    const ready = state.history.length > 0;
    return h("div", { class: "next" },
      !ready && h("p", { class: "soft" }, "Choose a model first: a vehicle that comes with auvnn, or your own YAML file."),
      h("button", { type: "button", class: "primary", id: "compare", disabled: !ready, onclick: (e) => this.app.start("compare", [], e.target) }, state.answers.comparison ? "Compare again" : "Compare model and log"));
  }

  repaint() { if (this.group) this.group.repaint(); }
  close() { if (this.group) this.group.destroy(); }
}

function spark(values) {
  const seen = values.filter((v) => v !== null);
  if (seen.length < 2) return "";
  const low = Math.min(...seen), high = Math.max(...seen), span = high - low || 1;
  const points = values.map((v, k) => (v === null ? null : `${(100 * k / (values.length - 1)).toFixed(1)},${(17 - 15 * (v - low) / span).toFixed(1)}`)).filter(Boolean);
  return s("svg", { class: "spark", viewBox: "0 0 100 18", width: 100, height: 18, "aria-hidden": "true" }, s("polyline", { points: points.join(" ") }));
}
