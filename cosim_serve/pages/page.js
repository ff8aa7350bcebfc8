"use strict";
// Sends dropped files, sends forms without leaving the page, and keeps up with a diagnosis that is under way.
// The server draws every page; this script only puts the new one in the place of the old.

const SECOND = 1000;
const byId = (id) => document.getElementById(id);
const say = (text) => { byId("status").textContent = text; };

document.documentElement.classList.add("scripted");
document.addEventListener("submit", submitted);
document.addEventListener("change", changed);
for (const kind of ["dragenter", "dragover", "dragleave", "drop"]) document.addEventListener(kind, dragged);
prepare();

function prepare() {
  const main = byId("main");
  tellTimes(main);
  if (main.dataset.live) setTimeout(follow, SECOND);
  const report = byId("report");
  if (report) report.addEventListener("load", () => fit(report));
}

// Times as the reader's own clock shows them: the server may be in another zone, behind a tunnel.
function tellTimes(part) {
  for (const one of part.querySelectorAll("time")) {
    const at = new Date(one.dateTime), day = (time) => time.toDateString();
    const said = { hour: "2-digit", minute: "2-digit" };
    one.textContent = day(at) === day(new Date()) ? at.toLocaleTimeString([], said)
      : at.toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
    one.title = at.toLocaleString([], { dateStyle: "full", timeStyle: "long" });
  }
}

// The report has a page's height: it scrolls with this page, not inside it.
function fit(frame) {
  const inside = frame.contentDocument;
  if (!inside || !inside.body) return;
  const measure = () => { frame.style.height = `${inside.documentElement.getBoundingClientRect().height + 4}px`; };
  new ResizeObserver(measure).observe(inside.body);
  measure();
}

// Forms

async function submitted(event) {
  const form = event.target, question = form.dataset.ask;
  if (form.method === "get") return; // leads to a page of its own
  event.preventDefault();
  if (question && !confirm(question)) return;
  await send(form);
}

function changed(event) {
  if (event.target.id === "files") upload([...event.target.files]);
  else if (event.target.form && "auto" in event.target.form.dataset) send(event.target.form);
}

async function send(form) {
  const button = form.querySelector("button:not(.without-script)");
  if (button) button.disabled = true;
  await show(form.action, { method: "POST", body: new URLSearchParams(new FormData(form)) });
}

// Fetches a page and puts its content in the place of this one's; what was asked later is shown later.
let shown = Promise.resolve();
function show(address, options) {
  shown = shown.then(() => fetched(address, options));
  return shown;
}

async function fetched(address, options) {
  try {
    const answer = await fetch(address, options);
    const fresh = new DOMParser().parseFromString(await answer.text(), "text/html");
    if (!fresh.getElementById("main")) throw new Error(fresh.body.textContent);
    replace(fresh, new URL(answer.url).pathname);
  } catch (error) {
    gone(error);
  }
}

function replace(fresh, path) {
  const focused = document.activeElement && document.activeElement.id;
  const opened = [...document.querySelectorAll("details")].filter((one) => one.open).map((one) => one.id);
  const elsewhere = path !== location.pathname && !path.endsWith("/start");
  if (elsewhere) history.pushState(null, "", path.replace(/(\/jobs\/[^/]+)\/.*/, "$1"));
  document.title = fresh.title;
  byId("main").replaceWith(fresh.getElementById("main"));
  if (!elsewhere) for (const id of opened) if (byId(id)) byId(id).open = true;
  const problem = byId("problem"), target = (!elsewhere && focused && byId(focused)) || document.querySelector("h1");
  target.focus({ preventScroll: !elsewhere });
  if (problem) { say(problem.textContent); problem.scrollIntoView({ block: "nearest" }); }
  else if (byId("main").dataset.live) say(stage());
  if (elsewhere) scrollTo(0, 0);
  prepare();
}

function gone(error) {
  say("");
  say(`The server does not answer: ${error.message}. It may have ended; start cosim serve again.`);
  byId("status").className = "box";
}

window.addEventListener("popstate", () => location.reload());

// Progress

async function follow() {
  const main = byId("main"), before = main.dataset.live;
  if (!before) return;
  try {
    const fresh = new DOMParser().parseFromString(await (await fetch(location.href)).text(), "text/html");
    const now = fresh.getElementById("main");
    if (byId("main") !== main || !now) return;
    byId("status").className = "unseen";
    if (now.dataset.live !== before) {
      replace(fresh, location.pathname);
      say(`${document.querySelector("h1").textContent}: ${stage() || byId("main").dataset.state}`);
      return;
    }
    renew(fresh);
  } catch (error) {
    gone(error);
  }
  setTimeout(follow, SECOND);
}

// What a diagnosis under way does: a page may be shown for the first time after it was begun, and it is not said again.
const stage = () => (byId("main").dataset.live && byId("progress").dataset.said) || "";

function renew(fresh) {
  document.querySelector("h1").textContent = fresh.querySelector("h1").textContent;
  for (const old of document.querySelectorAll("[data-part]")) {
    const now = fresh.getElementById(old.id);
    tellTimes(now);
    if (now.innerHTML === old.innerHTML) continue;
    const open = [...old.querySelectorAll("details")].some((one) => one.open), focused = document.activeElement.id;
    old.innerHTML = now.innerHTML;
    for (const one of old.querySelectorAll("details")) one.open = open;
    if (focused && byId(focused) && byId(focused) !== document.activeElement) byId(focused).focus();
    if (now.dataset.said && now.dataset.said !== old.dataset.said) say(now.dataset.said);
    old.dataset.said = now.dataset.said || "";
  }
}

// Files

function dragged(event) {
  const zone = document.querySelector("[data-drop]");
  if (!event.dataTransfer || ![...event.dataTransfer.types].includes("Files")) return;
  event.preventDefault(); // a file that misses the zone must not replace the page
  if (!zone) return;
  zone.classList.toggle("over", event.type === "dragover" || event.type === "dragenter");
  if (event.type === "drop") upload([...event.dataTransfer.files]);
}

async function upload(files) {
  if (!files.length) return;
  const zone = document.querySelector("[data-drop]"), list = byId("uploads");
  let refused = 0;
  try {
    const job = zone.dataset.drop || new URL((await fetch("/jobs", { method: "POST" })).url).pathname;
    list.replaceChildren();
    for (const file of [...files].sort((a, b) => isCard(b) - isCard(a))) refused += !(await put(job, file, list));
    say(`${files.length - refused} of ${files.length} files read.`);
    const kept = [...list.querySelectorAll(".bad")];
    await show(job);
    if (kept.length && byId("uploads")) byId("uploads").replaceChildren(...kept.map((one) => one.parentElement));
  } catch (error) {
    gone(error);
  }
}

const isCard = (file) => file.name.toLowerCase().endsWith(".toml");

function put(job, file, list) {
  const row = list.appendChild(document.createElement("li"));
  const label = row.appendChild(document.createElement("span"));
  const bar = row.appendChild(document.createElement("progress"));
  label.textContent = file.name;
  bar.setAttribute("aria-label", file.name);
  return new Promise((resolve) => {
    const request = new XMLHttpRequest();
    request.open("PUT", `${job}/files?name=${encodeURIComponent(file.name)}`);
    request.upload.addEventListener("progress", (event) => { bar.max = event.total; bar.value = event.loaded; });
    request.upload.addEventListener("load", () => { bar.removeAttribute("value"); label.textContent = `${file.name}: reading`; });
    request.addEventListener("loadend", () => {
      bar.remove();
      if (request.status === 201) return resolve(true);
      label.className = "bad";
      label.textContent = problemOf(request, file);
      resolve(false);
    });
    request.send(file);
  });
}

function problemOf(request, file) {
  try { return JSON.parse(request.responseText).problem; } catch { return `${file.name} did not arrive.`; }
}
