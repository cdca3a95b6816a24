// Draws the page's figures with uPlot: zoom by dragging, reset by double click, cursors shared within a group.
// The drawings that stand in the page stay for paper, and for screens without scripts.
(() => {
  "use strict";
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  let plots = [];

  const marks = {
    dots(u, ctx, layer, ratio) {
      const cross = layer.role === "cooling", ring = layer.role === "before";
      const size = (cross ? 3 : layer.role === "excluded" ? 4 : layer.role === "steady" ? 1.4 : 2.1) * ratio;
      ctx.globalAlpha = 0.65;
      ctx.lineWidth = 1.3 * ratio;
      ctx.beginPath();
      layer.x.forEach((x, i) => {
        if (layer.y[i] === null) return;
        const px = u.valToPos(x, "x", true), py = u.valToPos(layer.y[i], "y", true);
        if (cross) {
          ctx.moveTo(px - size, py); ctx.lineTo(px + size, py); ctx.moveTo(px, py - size); ctx.lineTo(px, py + size);
        } else {
          ctx.moveTo(px + size, py); ctx.arc(px, py, size, 0, 2 * Math.PI);
        }
      });
      cross || ring ? ctx.stroke() : ctx.fill();
    },
    line(u, ctx, layer, ratio) {
      ctx.lineWidth = 2 * ratio;
      if (layer.dash) ctx.setLineDash(layer.dash.map((length) => length * ratio));
      ctx.beginPath();
      layer.x.forEach((x, i) => {
        const at = [u.valToPos(x, "x", true), u.valToPos(layer.y[i], "y", true)];
        i ? ctx.lineTo(...at) : ctx.moveTo(...at);
      });
      ctx.stroke();
    },
    band(u, ctx, layer) {
      ctx.globalAlpha = 0.2;
      ctx.beginPath();
      layer.x.forEach((x, i) => ctx[i ? "lineTo" : "moveTo"](u.valToPos(x, "x", true), u.valToPos(layer.hi[i], "y", true)));
      for (let i = layer.x.length - 1; i >= 0; i--) ctx.lineTo(u.valToPos(layer.x[i], "x", true), u.valToPos(layer.lo[i], "y", true));
      ctx.fill();
    },
    whiskers(u, ctx, layer, ratio) {
      ctx.lineWidth = 2 * ratio;
      ctx.beginPath();
      layer.x.forEach((x, i) => {
        const px = u.valToPos(x, "x", true);
        ctx.moveTo(px, u.valToPos(layer.y[i] - layer.half[i], "y", true));
        ctx.lineTo(px, u.valToPos(layer.y[i] + layer.half[i], "y", true));
      });
      ctx.stroke();
      (layer.joined ? marks.line : marks.dots)(u, ctx, layer, ratio);
    },
    bars(u, ctx, layer) {
      ctx.globalAlpha = 0.6;
      const bottom = u.valToPos(0, "y", true);
      layer.heights.forEach((height, i) => {
        const left = u.valToPos(layer.edges[i], "x", true), right = u.valToPos(layer.edges[i + 1], "x", true);
        const top = u.valToPos(height, "y", true);
        ctx.fillRect(left, top, right - left - 1, bottom - top);
      });
    },
    shades(u, ctx, layer) {
      ctx.globalAlpha = 0.3;
      for (const [from, to] of layer.stretches) {
        const left = u.valToPos(from, "x", true);
        ctx.fillRect(left, u.bbox.top, Math.max(u.valToPos(to, "x", true) - left, 1), u.bbox.height);
      }
    },
  };

  function draw(u, figure) {
    const ctx = u.ctx, ratio = uPlot.pxRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    ctx.clip();
    for (const layer of figure.layers) {
      ctx.save();
      ctx.fillStyle = ctx.strokeStyle = css(layer.role);
      marks[layer.kind](u, ctx, layer, ratio);
      ctx.restore();
    }
    ctx.restore();
  }

  // Names each cell of a table after its column: a narrow screen shows a row as a list of names and values.
  for (const table of document.querySelectorAll("table")) {
    const names = [...table.querySelectorAll("thead th")].map((th) => th.textContent.trim());
    table.classList.toggle("listed", names.length > 2);
    for (const row of table.querySelectorAll("tr")) {
      [...row.children].forEach((cell, i) => { if (names[i] && cell.tagName === "TD") cell.dataset.name = names[i]; });
    }
  }

  // 1, 2 and 5 times the powers of ten between the ends; the powers alone where there are many.
  function decades(u, axis, min, max) {
    const from = Math.floor(Math.log10(min)), to = Math.ceil(Math.log10(max)), all = [];
    const steps = to - from > 4 ? [1] : [1, 2, 5];
    for (let power = from; power <= to; power++) for (const step of steps) all.push(step * 10 ** power);
    return all.filter((tick) => tick >= min && tick <= max);
  }

  const short = (value) => {
    const rounded = Number(value.toPrecision(4)), size = Math.abs(rounded);
    const text = size > 0 && size < 1e-4 ? rounded.toExponential() : rounded.toString();
    return text.replaceAll("-", "\u2212");
  };

  // What lies under the cursor: the nearest point in words.
  function read(u, figure, out) {
    const { left, top } = u.cursor;
    if (left === undefined || left < 0 || top < 0) { out.textContent = ""; return; }
    let best = null, least = 24 ** 2;
    for (const layer of figure.layers.filter((l) => l.y)) {
      layer.x.forEach((x, i) => {
        if (layer.y[i] === null) return;
        const far = (u.valToPos(x, "x") - left) ** 2 + (u.valToPos(layer.y[i], "y") - top) ** 2;
        if (far < least) { least = far; best = [layer.label, x, layer.y[i]]; }
      });
    }
    const at = best || ["cursor", u.posToVal(left, "x"), u.posToVal(top, "y")];
    out.textContent = `${at[0] || "point"}: ${figure.x_label} ${short(at[1])}; ${figure.y_label} ${short(at[2])}`;
  }

  let zooming = false;
  function zoomed(u, key, figure) {
    if (key !== "x" || zooming) return;
    zooming = true;
    const { min, max } = u.scales.x;
    for (const other of plots) if (other.figure.group === figure.group && other.u !== u) other.u.setScale("x", { min, max });
    zooming = false;
  }

  function build(figure) {
    const holder = document.getElementById(figure.id);
    const out = holder.parentElement.querySelector(".readout");
    const axis = (label, size) => ({
      label, stroke: css("soft"), grid: { stroke: css("grid"), width: 1 }, ticks: { stroke: css("line"), width: 1 },
      values: (u, ticks) => ticks.map((tick) => (tick === null ? "" : short(tick))),
      ...(figure.decades ? { splits: decades, filter: (u, ticks) => ticks } : {}),
      font: "12px system-ui, sans-serif", labelFont: "12.5px system-ui, sans-serif", labelSize: 22, size,
    });
    // Room for the longest number.
    const wide = (u, numbers) => Math.max(66, 16 + 7 * Math.max(0, ...(numbers || []).map((number) => number.length)));
    const keep = (u, min, max) => [min, max];
    const distr = figure.decades ? 3 : 1;
    const u = new uPlot({
      width: holder.clientWidth || 860, height: 340, legend: { show: false },
      scales: { x: { time: false, range: keep, distr }, y: { range: keep, distr } },
      axes: [axis(figure.x_label, 40), axis(figure.y_label, wide)],
      series: [{}, { show: true, stroke: "transparent", points: { show: false } }],
      cursor: { drag: { x: true, y: true, uni: 24 }, points: { show: false }, sync: { key: figure.group, scales: ["x", null], setSeries: false } },
      hooks: {
        drawClear: [], draw: [(u) => draw(u, figure)], setCursor: [(u) => read(u, figure, out)],
        setScale: [(u, key) => zoomed(u, key, figure)],
      },
    }, [figure.x, figure.y], holder);
    plots.push({ u, figure, holder });
  }

  function all() {
    plots.forEach((p) => p.u.destroy());
    plots = [];
    figures.forEach(build);
  }

  document.documentElement.classList.add("live");
  all();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", all);
  let waiting = 0;
  addEventListener("resize", () => {
    cancelAnimationFrame(waiting);
    waiting = requestAnimationFrame(() => plots.forEach((p) => p.u.setSize({ width: p.holder.clientWidth, height: 340 })));
  });
})();
