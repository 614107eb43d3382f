// What the page asks of its own server; every address is relative, so that it carries the token.

import { h } from "./dom.js";

async function answer(response) {
  let data = null;
  try { data = await response.json(); } catch { data = null; }
  if (response.ok) return data;
  throw new Error((data && data.error) || `the server answered ${response.status}`);
}

export async function get(name, asked = {}) {
  const query = new URLSearchParams();
  for (const [key, value] of Object.entries(asked)) if (value !== null && value !== undefined) query.set(key, value);
  const text = query.toString();
  return answer(await fetch(`api/${name}${text ? `?${text}` : ""}`, { headers: { accept: "application/json" } }));
}

export async function post(name, asked = {}) {
  return answer(await fetch(`api/${name}`, {
    method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(asked),
  }));
}

export async function upload(file, use = "log") {
  const query = new URLSearchParams({ name: file.name, use });
  return answer(await fetch(`api/upload?${query}`, { method: "PUT", body: file }));
}

// One line that says what is wrong; it stays until it is closed or something else succeeds.
export function complain(error) {
  const words = String(error && error.message ? error.message : error);
  const line = h("div", { class: "alert" }, h("p", {}, words),
    h("button", { type: "button", class: "quiet", "aria-label": "Close this message", onclick: () => line.remove() }, "Close"));
  document.getElementById("alerts").replaceChildren(line);
}

export function settle() { document.getElementById("alerts").replaceChildren(); }

// Do something, and say in one line what went wrong with it.
export async function attempt(work, button) {
  if (button) button.disabled = true;
  try {
    const result = await work();
    settle();
    return result;
  } catch (error) {
    complain(error);
    return undefined;
  } finally {
    if (button) button.disabled = false;
  }
}
