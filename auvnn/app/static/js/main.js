// The frame of the page: steps at the side with the state of each, the job that runs, and the screen in view.

import { attempt, get, post, settle } from "./api.js";
import { h, number, percent, plural, show } from "./dom.js";
import { LogScreen } from "./log.js";
import { MissingScreen } from "./missing.js";
import { ResultScreen } from "./result.js";
import { TryScreen } from "./trial.js";
import { WhereScreen } from "./where.js";

const SCREENS = [
  { name: "log", title: "Log", make: LogScreen },
  { name: "where", title: "Where it fails", make: WhereScreen },
  { name: "missing", title: "What is missing", make: MissingScreen },
  { name: "try", title: "Try it", make: TryScreen },
  { name: "result", title: "Result", make: ResultScreen },
];

export const app = {
  state: null, screen: null, name: "", tried: {},
  go(name) { if (location.hash === `#${name}`) open(); else location.hash = name; },
  async changed(state) { take(state || await get("state")); },
  async start(kind, effects, button) { await attempt(async () => take(await post("start", { kind, effects })), button); },
};

let last = "", waiting = null, finished = null;

function words(name, state) {
  const answers = state.answers, log = state.log;
  const of = (kind) => answers[kind] && answers[kind].summary;
  const old = (kind) => (answers[kind] && answers[kind].stale ? " (of the earlier model)" : "");
  switch (name) {
    case "log":
      if (state.reading) return ["busy", "is being read"];
      if (!log) return ["open", "no log yet"];
      if (log.error && !log.ready) return ["bad", "cannot be read"];
      if (log.sizes.errors) return ["bad", plural(log.sizes.errors, "error")];
      if (!log.judged) return ["busy", "is being checked"];
      return ["done", log.sizes.warnings ? plural(log.sizes.warnings, "warning") : "no objections"];
    case "where": {
      const done = of("comparison");
      return done ? [answers.comparison.stale ? "old" : "done", `error ${number(done.total)} at 5 s${old("comparison")}`] : ["open", "not compared yet"];
    }
    case "missing": {
      const done = of("diagnosis");
      if (!done) return ["open", "not asked yet"];
      const told = { adequate: "nothing this log can show", unknown: "something without a name", partial: "names that predict, no cause" };
      return [answers.diagnosis.stale ? "old" : "done", (told[done.verdict] || done.missing.join(done.verdict === "ambiguous" ? " or " : ", ")) + old("diagnosis")];
    }
    case "try": {
      const done = of("improvement");
      if (!done) return ["open", state.history.length > 1 ? "a fit was kept" : "nothing fitted yet"];
      if (state.can_keep) return ["done", done.accepted ? "fitted, accepted" : "fitted, not accepted"];
      return ["done", "fitted and kept"];
    }
    default: {
      if (state.saved.length) return ["done", "saved"];
      const step = state.history[state.history.length - 1];
      if (state.history.length < 2 || !step.error.before) return ["open", "nothing kept yet"];
      return ["done", `error ${percent(1 - step.error.after / step.error.before)} lower`];
    }
  }
}

function steps(state) {
  show(document.getElementById("steps"), SCREENS.map((screen, k) => {
    const [kind, said] = words(screen.name, state);
    return h("li", {}, h("a", { href: `#${screen.name}`, class: `step ${kind}`, "aria-current": screen.name === app.name ? "page" : null, title: `Key ${k + 1}` },
      h("span", { class: "count", "aria-hidden": "true" }, k + 1),
      h("span", { class: "what" }, h("span", { class: "title" }, screen.title), h("span", { class: "said" }, said))));
  }));
}

function job(state) {
  const place = document.getElementById("job"), now = state.job;
  if (!now || (now.state === "done")) { place.hidden = true; show(place); return; }
  if (now.state !== "running" && finished === now.number) { place.hidden = true; show(place); return; }
  const running = now.state === "running";
  place.hidden = false;
  const told = { running: "", stopped: "Stopped; nothing of it was kept.", failed: now.error }[now.state];
  show(place,
    h("p", { class: "title" }, now.words),
    running && h("div", { class: "bar-of-work", "aria-hidden": "true" }, h("span", {})),
    h("p", { class: running ? "quiet-words" : "said" }, running ? `${Math.round(now.seconds)} s · ${now.lines[now.lines.length - 1] || "begins"}` : told),
    running && now.lines.length > 1 && h("details", {}, h("summary", {}, plural(now.count, "step")), h("ol", { class: "lines" }, now.lines.map((line) => h("li", {}, line)))),
    running
      ? h("button", { type: "button", class: "stop", id: "stop", onclick: (e) => attempt(async () => take(await post("stop").then(() => get("state"))), e.target) }, "Stop")
      : h("button", { type: "button", class: "small", onclick: () => { finished = now.number; place.hidden = true; } }, "Close"));
}

function take(state) {
  const before = app.state;
  app.state = state;
  const opened = document.querySelector("#job details[open]") !== null;
  const focused = document.activeElement && document.activeElement.id === "stop";
  job(state);
  if (opened) { const now = document.querySelector("#job details"); if (now) now.open = true; }
  if (focused && document.getElementById("stop")) document.getElementById("stop").focus();
  const parts = [state.log && state.log.name, state.history.length && state.history[0].source, state.history.length > 1 && state.history.slice(1).map((s) => s.words).join(", ")];
  const about = parts.filter(Boolean).join("  ·  ");
  if (document.getElementById("about").textContent !== about) document.getElementById("about").textContent = about;
  const key = JSON.stringify([state.log, state.history, state.answers, state.can_keep, state.saved, state.taken_back, state.reading, app.name]);
  if (key !== last) { last = key; steps(state); if (app.screen) app.screen.update(state); }
  const was = before && before.job, now = state.job;
  const ended = was && now && was.state === "running" && was.number === now.number && now.state !== "running";
  if (ended) {
    document.getElementById("status").textContent = `${now.words}: ${now.state}`;
    if (now.state === "done") {
      settle();
      const next = { compare: "where", diagnose: "missing", add: "try", improve: "result", example: "log" }[now.kind];
      if (app.name !== next) app.go(next);
    }
  }
  const moving = state.reading || (now && now.state === "running") || (state.log && state.log.ready && !state.log.judged) || Object.values(state.answers).some((a) => !a.report);
  clearTimeout(waiting);
  waiting = setTimeout(poll, moving ? 300 : 3000);
}

let lost = false;
async function poll() {
  try {
    const state = await get("state");
    if (lost) { lost = false; settle(); }
    take(state);
  } catch (error) {
    if (!lost) { lost = true; await attempt(async () => { throw new Error("The server does not answer: it was closed. Start auvnn app again; nothing that was saved is lost."); }); }
    clearTimeout(waiting);
    waiting = setTimeout(poll, 2000);
  }
}

function open() {
  const name = location.hash.slice(1);
  const found = SCREENS.find((screen) => screen.name === name) || SCREENS[0];
  if (app.screen && app.screen.close) app.screen.close();
  app.name = found.name;
  document.title = `${found.title} · auvnn`;
  app.screen = new found.make(app);
  show(document.getElementById("main"), h("h1", {}, found.title), app.screen.element);
  last = "";
  if (app.state) take(app.state);
}

function theme(now) {
  document.documentElement.dataset.theme = now;
  if (app.screen && app.screen.repaint) app.screen.repaint();
}

const dark = window.matchMedia("(prefers-color-scheme: dark)");
let chosen = null;
try { chosen = localStorage.getItem("auvnn-theme"); } catch { chosen = null; }
theme(chosen || (dark.matches ? "dark" : "light"));
dark.addEventListener("change", () => { if (!chosen) theme(dark.matches ? "dark" : "light"); });
document.getElementById("theme").addEventListener("click", () => {
  chosen = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  try { localStorage.setItem("auvnn-theme", chosen); } catch { /* a private window keeps nothing */ }
  theme(chosen);
});
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName)) return;
  const screen = SCREENS[Number(event.key) - 1];
  if (screen) app.go(screen.name);
});
// A file may be dropped anywhere on the page.
for (const kind of ["dragover", "drop"]) document.addEventListener(kind, (event) => event.preventDefault());
document.addEventListener("drop", (event) => {
  const file = event.dataTransfer && event.dataTransfer.files[0];
  if (!file) return;
  if (app.name !== "log") app.go("log");
  setTimeout(() => app.screen.drop(file), 0);
});
window.addEventListener("hashchange", () => { if (SCREENS.some((screen) => `#${screen.name}` === location.hash)) { open(); document.getElementById("main").focus({ preventScroll: true }); window.scrollTo(0, 0); } });

get("state").then((state) => { app.state = state; open(); }).catch(() => { open(); poll(); });
