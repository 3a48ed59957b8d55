"use strict";
// Signals are stored as differences of whole numbers, compressed; what is in view is thinned to the width of the screen.
(async () => {
  const root = document.querySelector(".traces"), moving = root.querySelector(".moving");
  const data = JSON.parse(document.getElementById("traces-data").textContent);
  const [begin, end] = data.span;
  if (typeof DecompressionStream === "undefined") return;

  const unpacked = async (text, bytes) => {
    const packed = new Blob([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))]);
    const plane = new Uint8Array(await new Response(packed.stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer());
    const count = plane.length / bytes, made = new Uint32Array(count);
    for (let b = 0; b < bytes; b++) for (let i = 0; i < count; i++) made[i] += plane[b * count + i] << (8 * b);
    return made;
  };
  const opened = async (track) => {
    const steps = await unpacked(track.time, 4), raw = await unpacked(track.values, 2), count = steps.length;
    const time = new Float64Array(count);
    for (let i = 0, at = 0; i < count; i++) time[i] = begin + (at += steps[i]) * data.tick;
    const values = track.scales.map(([low, step], channel) => {
      const made = new Float32Array(count);
      for (let i = 0, level = 0; i < count; i++) {
        level = (level + raw[channel * count + i]) & 65535;
        made[i] = level ? low + (level - 1) * step : NaN;
      }
      return made;
    });
    return { ...track, time, values };
  };
  const first = (time, at) => {
    let low = 0, high = time.length;
    while (low < high) { const mid = (low + high) >> 1; if (time[mid] < at) low = mid + 1; else high = mid; }
    return low;
  };
  // Lowest and highest of each pixel, in the order in which they come.
  const inView = ({ time, values }, from, to, pixels) => {
    const start = Math.max(0, first(time, from) - 1), stop = Math.min(time.length, first(time, to) + 1);
    const size = Math.ceil((stop - start) / pixels), x = [];
    const given = (value) => (Number.isNaN(value) ? null : value);
    if (size <= 3) {
      return [Array.from(time.subarray(start, stop)), ...values.map((own) => Array.from(own.subarray(start, stop), given))];
    }
    for (let i = start; i < stop; i += size) x.push(time[i], time[Math.min(i + (size >> 1), stop - 1)]);
    return [x, ...values.map((own) => {
      const y = [];
      for (let i = start; i < stop; i += size) {
        let low = i, high = i, gap = false;
        for (let j = i; j < Math.min(i + size, stop); j++) {
          const value = own[j];
          if (value !== value) { gap = true; continue; }
          if (!(own[low] <= value)) low = j;
          if (!(own[high] >= value)) high = j;
        }
        const [one, other] = low < high ? [low, high] : [high, low];
        y.push(gap ? null : own[one], given(own[other]));
      }
      return y;
    })];
  };

  const colour = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const events = [...root.querySelectorAll(".events li")].map((li) => ({ li, from: +li.dataset.from, to: +li.dataset.to, severity: li.className }));
  const ofSeverity = { note: "--soft", warning: "--c1", danger: "--warning" };
  const panels = await Promise.all(data.panels.map(async (panel) => ({ ...panel, tracks: await Promise.all(panel.tracks.map(opened)) })));
  let view = [begin, end];

  const draw = (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const { from, to, severity } of events) {
      const a = u.valToPos(from, "x", true), b = u.valToPos(to, "x", true);
      ctx.fillStyle = ctx.strokeStyle = colour(ofSeverity[severity]);
      ctx.globalAlpha = 0.12;
      // What lasts and needs no look would shade the whole flight.
      if (b > a && severity !== "note") ctx.fillRect(a, bbox.top, b - a, bbox.height);
      ctx.globalAlpha = 0.8;
      ctx.setLineDash([4, 4]);
      ctx.beginPath();
      ctx.moveTo(a, bbox.top);
      ctx.lineTo(a, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  };
  // Signals of another clock have nothing at most stamps: the nearest value is read.
  const nearest = (u, series, at) => {
    const own = u.data[series];
    for (let step = 0; step < 200; step++) {
      if (own[at - step] !== undefined) return at - step;
      if (own[at + step] !== undefined) return at + step;
    }
    return at;
  };
  const width = () => Math.max(240, moving.clientWidth);
  const seen = (panel) => uPlot.join(panel.tracks.map((track) => inView(track, ...view, 2 * width())));
  const show = () => panels.forEach((panel) => panel.plot.batch(() => {
    panel.plot.setData(seen(panel), false);
    panel.plot.setScale("x", { min: view[0], max: view[1] });
  }));
  const zoom = (from, to) => {
    const least = 20 * data.tick, middle = (from + to) / 2, half = Math.max(least, to - from) / 2;
    view = half * 2 >= end - begin ? [begin, end] : [middle - half, middle + half];
    if (view[0] < begin) view = [begin, begin + 2 * half];
    if (view[1] > end) view = [end - 2 * half, end];
    show();
  };
  const plotOf = (panel, last) => {
    const box = document.createElement("div"), head = document.createElement("div");
    box.className = "panel";
    head.className = "head";
    head.append(Object.assign(document.createElement("strong"), { textContent: panel.title }));
    box.append(head);
    moving.append(box);
    const axis = { stroke: () => colour("--soft"), grid: { stroke: () => colour("--line"), width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif" };
    const number = (u, value) => (value == null ? "" : Math.abs(value) >= 100 ? value.toFixed(0) : Math.abs(value) >= 1 ? value.toFixed(2) : value.toFixed(3));
    return new uPlot({
      width: width(), height: last ? 158 : 132, padding: [8, 8, 0, 0],
      cursor: { y: false, sync: { key: "traces", filters: { sub: (type) => type === "mousemove" || type === "mouseleave" } }, drag: { x: true, y: false, setScale: false }, dataIdx: nearest, points: { size: 5 }, bind: { dblclick: () => () => zoom(begin, end) } },
      legend: { mount: (u, table) => head.append(table), markers: { width: 2, stroke: (u, i) => `var(--c${u.series[i].shade})`, dash: (u, i) => (u.series[i].dash ? "dashed" : "solid") } },
      scales: { x: { time: false, min: begin, max: end } },
      axes: [{ ...axis, size: last ? 26 : 0, values: (u, at) => at.map((v) => (last ? `${+v.toFixed(4)} s` : "")) }, { ...axis, size: 52 }],
      series: [{ label: "time", value: (u, v) => (v == null ? "" : `${v.toFixed(3)} s`) }, ...panel.tracks.flatMap((track) => track.labels.map((label, i) => ({
        label, shade: i % 8, stroke: () => colour(`--c${i % 8}`), width: 1, dash: track.dashed ? [5, 3] : undefined, points: { show: false }, value: number,
      })))],
      hooks: { drawAxes: [draw], setSelect: [(u) => {
        if (u.select.width > 3) zoom(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x"));
        u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
      }] },
    }, seen(panel), box);
  };

  const bar = document.createElement("div");
  bar.className = "bar";
  const by = (share, move) => () => {
    const half = ((view[1] - view[0]) / 2) * share, middle = (view[0] + view[1]) / 2 + move * (view[1] - view[0]);
    zoom(middle - half, middle + half);
  };
  for (const [text, label, act] of [["Whole log", "Show the whole log", () => zoom(begin, end)], ["+", "Zoom in", by(0.5, 0)], ["−", "Zoom out", by(2, 0)], ["◀", "Earlier", by(1, -0.5)], ["▶", "Later", by(1, 0.5)]]) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: text, onclick: act });
    button.setAttribute("aria-label", label);
    bar.append(button);
  }
  for (const { li, from, to } of events) {
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: li.textContent });
    button.onclick = () => { zoom(from - 2, to + 2); };
    li.replaceChildren(button);
  }
  root.classList.add("live");
  moving.before(bar);
  panels.forEach((panel, at) => { panel.plot = plotOf(panel, at === panels.length - 1); });
  new ResizeObserver(() => {
    panels.forEach(({ plot }) => plot.width === width() || plot.setSize({ width: width(), height: plot.height }));
    show();
  }).observe(moving);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => panels.forEach(({ plot }) => plot.redraw()));
})();
