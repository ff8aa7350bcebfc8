// Draws records on a canvas, sheet above sheet over time; `data` is what explorer.py packs. Drag to zoom, double-click for all, arrow keys move, + and - zoom.
(async () => {
  const box = document.getElementById("explorer"), canvas = box.querySelector("canvas");
  const data = JSON.parse(document.getElementById("recordings").textContent);
  const ink = {};
  function colours() { // of the page, light or dark
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ink", "before", "after", "grey", "grid", "shade", "paper"]) ink[name] = style.getPropertyValue(`--${name}`).trim();
  }
  if (!window.DecompressionStream || !data.recordings.length) return;
  let record, view, drag;

  async function unpack(recording) {
    if (recording.values) return recording;
    const bytes = Uint8Array.from(atob(recording.data), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    const deltas = new Uint16Array(await new Response(stream).arrayBuffer());
    recording.values = {};
    recording.signals.forEach(([name, low, step], row) => {
      const values = new Float32Array(recording.count);
      let level = 0;
      for (let i = 0; i < recording.count; i++) {
        level = (level + deltas[row * recording.count + i]) & 65535;
        values[i] = level === 65535 ? NaN : low + step * level;
      }
      recording.values[name] = values;
    });
    for (const [name, one, other] of data.differences) {
      recording.values[name] = recording.values[one].map((x, i) => x - recording.values[other][i]);
    }
    return recording;
  }

  const index = (t) => ((t - record.start) / record.length) * record.count;

  function ticks(low, high, room) { // round numbers, at least three of them
    const raw = (high - low) / Math.max(3, room), power = 10 ** Math.floor(Math.log10(raw)), out = [];
    const fits = (step) => step >= raw && Math.floor(high / step + 1e-9) - Math.ceil(low / step - 1e-9) >= 2;
    const steps = [10, 5, 2, 1, 0.5, 0.2].map((m) => m * power);
    const step = steps.filter(fits).pop() || steps.find((s) => Math.floor(high / s + 1e-9) - Math.ceil(low / s - 1e-9) >= 2);
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push(k * step);
    return [out, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))];
  }

  function panel(g, frame, lines, title) {
    const first = Math.max(0, Math.floor(index(view[0]))), last = Math.min(record.count - 1, Math.ceil(index(view[1])));
    let low = Infinity, high = -Infinity;
    lines = lines.filter(([name]) => record.values[name]);
    for (const [name] of lines) for (let i = first; i <= last; i++) {
      const y = record.values[name][i];
      if (y < low) low = y;
      if (y > high) high = y;
    }
    if (!(high > low)) { low -= 1; high += 1; }
    const x = (t) => frame.x + ((t - view[0]) / (view[1] - view[0])) * frame.w;
    const y = (v) => frame.y + frame.h - ((v - low) / (high - low)) * frame.h;
    g.fillStyle = record.heldout ? ink.shade : ink.paper;
    g.fillRect(frame.x, frame.y, frame.w, frame.h);
    const [marks, places] = ticks(low, high, frame.h / 38);
    g.textAlign = "right";
    for (const mark of marks) {
      g.fillStyle = ink.grid; g.fillRect(frame.x, y(mark), frame.w, 1);
      g.fillStyle = ink.grey; g.fillText(mark.toFixed(places).replace("-", "−"), frame.x - 6, y(mark) + 4);
    }
    g.textAlign = "left"; g.fillStyle = ink.grey; g.fillText(title, 0, frame.y - 9);
    g.save(); g.beginPath(); g.rect(frame.x, frame.y, frame.w, frame.h); g.clip();
    for (const [name, colour, dash] of lines) {
      g.beginPath(); g.strokeStyle = ink[colour]; g.lineWidth = 1.4; g.setLineDash(dash);
      let pen = false;
      for (let i = first; i <= last; i++) {
        const value = record.values[name][i];
        if (Number.isNaN(value)) { pen = false; continue; }
        const at = x(record.start + ((i + 0.5) / record.count) * record.length);
        if (pen) g.lineTo(at, y(value)); else g.moveTo(at, y(value));
        pen = true;
      }
      g.stroke();
    }
    g.restore();
    return x;
  }

  function draw() {
    colours();
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    canvas.width = w * ratio; canvas.height = h * ratio;
    const g = canvas.getContext("2d");
    g.scale(ratio, ratio); g.font = getComputedStyle(canvas).font;
    const left = 50, width = w - left - 16, gap = 32, free = h - 24 - gap * (data.sheets.length - 1) - 44;
    let top = 24, x;
    data.sheets.forEach(({ title, share, lines }, row) => {
      x = panel(g, { x: left, y: top, w: width, h: free * share }, lines, (record.titles || [])[row] || title);
      top += free * share + gap;
    });
    const [marks, places] = ticks(view[0], view[1], width / 90);
    g.textAlign = "center"; g.fillStyle = ink.grey;
    for (const mark of marks) g.fillText(mark.toFixed(places), x(mark), top - gap + 18);
    g.fillText("time [s]", left + width / 2, top - gap + 38);
    if (drag && drag.to !== undefined) {
      g.fillStyle = "rgba(0,85,140,.15)"; g.fillRect(Math.min(drag.from, drag.to), 24, Math.abs(drag.to - drag.from), top - gap - 24);
    }
  }

  function show(low, high) {
    const end = record.start + record.length, span = Math.min(Math.max(high - low, 0.05), record.length);
    const start = Math.min(Math.max(low, record.start), end - span);
    view = [start, start + span];
    draw();
  }

  async function open(number, span) {
    record = await unpack(data.recordings[number]);
    show(...(span || record.spans[data.first] || [record.start, record.start + record.length]));
  }

  const time = (px) => view[0] + ((px - 50) / (canvas.clientWidth - 66)) * (view[1] - view[0]);
  canvas.addEventListener("pointerdown", (e) => { drag = { from: e.offsetX }; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener("pointermove", (e) => { if (drag) { drag.to = e.offsetX; draw(); } });
  canvas.addEventListener("pointercancel", () => { drag = undefined; draw(); });
  canvas.addEventListener("pointerup", (e) => {
    const from = drag && drag.from; drag = undefined;
    if (from !== undefined && Math.abs(e.offsetX - from) > 6) show(...[time(from), time(e.offsetX)].sort((a, b) => a - b));
    else draw();
  });
  canvas.addEventListener("dblclick", () => show(record.start, record.start + record.length));
  canvas.addEventListener("keydown", (e) => {
    const span = view[1] - view[0], move = { ArrowLeft: -0.25, ArrowRight: 0.25 }[e.key], zoom = { "+": 0.5, "-": 2 }[e.key];
    if (move) show(view[0] + move * span, view[1] + move * span);
    if (zoom) show(view[0] + (span - span * zoom) / 2, view[1] - (span - span * zoom) / 2);
    if (move || zoom) e.preventDefault();
  });
  const select = box.querySelector("select");
  data.recordings.forEach((r, i) => select.add(new Option(r.name + (r.heldout ? " (not fitted)" : ""), i, false, i === data.open)));
  select.addEventListener("change", () => open(+select.value));
  for (const button of box.querySelectorAll("button")) {
    button.addEventListener("click", () => show(...(record.spans[button.dataset.to] || [record.start, record.start + record.length])));
  }
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => view && draw());
  addEventListener("beforeprint", () => { canvas.style.width = "680px"; if (view) draw(); }); // drawn at the width of a sheet, its letters stay letters
  addEventListener("afterprint", () => { canvas.style.width = ""; if (view) draw(); });
  new ResizeObserver(() => view && draw()).observe(canvas);
  box.hidden = false;
  await open(data.open);
  box.dataset.ready = "yes";
})();
