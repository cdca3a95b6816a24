// The page of a running test. Everything that comes from a log is put in as text, never as markup.
(() => {
  "use strict";
  const at = (id) => document.getElementById(id);
  const root = document.documentElement;
  const css = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();
  const palette = ["after", "before", "floor", "excluded", "accent", "temperature"];
  const colour = (i) => css(palette[i % palette.length]);
  const figures = { rate: null, temperature: null, residual: null, known: null, allan: null };
  let state = null, source = null, heard = 0, loading = false;

  const figures3 = (value) => {
    if (value === null || value === undefined || !isFinite(value)) return "–";
    const size = Math.abs(value);
    const text = size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(2) : value.toPrecision(size >= 100 ? Math.min(7, Math.ceil(Math.log10(size)) + 1) : 3);
    return text.replace("-", "−");
  };
  const degrees = (celsius) => String(Math.round(celsius)).replace("-", "−");
  const unit = (text) => text.replaceAll("degC", "°C").replaceAll("deg/", "°/");
  const long = (seconds) => {
    if (seconds < 120) return Math.round(seconds) + " s";
    if (seconds < 7200) return Math.round(seconds / 60) + " min";
    return (seconds / 3600).toFixed(1) + " h";
  };
  const put = (id, text) => { const e = at(id); if (e.textContent !== text) e.textContent = text; };
  const cell = (text, name) => { const td = document.createElement("td"); td.textContent = text; if (name) td.className = name; return td; };
  const row = (...cells) => { const tr = document.createElement("tr"); tr.append(...cells); return tr; };
  const item = (text, name) => { const li = document.createElement("li"); li.textContent = text; if (name) li.className = name; return li; };

  // Figures ---------------------------------------------------------------------------------------------------------------
  const band = (lo, hi, stroke) => (u) => {
    const ctx = u.ctx, x = u.data[0];
    ctx.save();
    ctx.globalAlpha = 0.2;
    ctx.fillStyle = stroke;
    ctx.beginPath();
    x.forEach((v, i) => ctx[i ? "lineTo" : "moveTo"](u.valToPos(v, "x", true), u.valToPos(lo[i], "y", true)));
    for (let i = x.length - 1; i >= 0; i--) ctx.lineTo(u.valToPos(x[i], "x", true), u.valToPos(hi[i], "y", true));
    ctx.fill();
    ctx.restore();
  };
  const figure = (name, data, series, options = {}) => {
    const box = at("figure-" + name).querySelector(".plot");
    const legend = at("figure-" + name).querySelector(".legend");
    const old = figures[name];
    const key = JSON.stringify([series.map((s) => [s.label, s.stroke]), options.key, root.className]);
    if (old && old.key === key) {
      old.bands = options.bands;
      old.plot.setData(data);
      return;
    }
    if (old) old.plot.destroy();
    legend.replaceChildren(...series.map((s) => {
      const span = document.createElement("span"), mark = document.createElement("i");
      mark.className = s.dots ? "dot" : "solid";
      mark.style.color = s.stroke;
      span.append(mark, s.label);
      return span;
    }));
    const axis = (label, more) => ({ stroke: css("soft"), grid: { stroke: css("grid"), width: 1 }, ticks: { stroke: css("grid") }, label, labelSize: 20, font: "12px system-ui", labelFont: "12px system-ui", ...more });
    const made = { key, bands: options.bands };
    made.plot = new uPlot({
      width: Math.max(280, box.clientWidth), height: innerWidth < 600 ? 200 : 260,
      scales: { x: { time: false, distr: options.log ? 3 : 1 }, y: { distr: options.log ? 3 : 1 } },
      axes: [axis(options.x), axis(options.y, { size: 64 })],
      cursor: { drag: { x: true, y: false } },
      legend: { show: false },
      hooks: { drawAxes: [(u) => (made.bands || []).forEach((draw) => draw(u))] },
      series: [{}, ...series.map((s) => ({ label: s.label, stroke: s.stroke, width: s.dots ? 0 : 2, dash: s.dash, spanGaps: false,
        paths: s.dots ? () => null : undefined, points: { show: s.dots === true, size: 5, fill: s.stroke } }))],
    }, data, box);
    figures[name] = made;
  };

  const drawRate = () => {
    const points = state.seconds;
    const data = [points.map((p) => p.t_s / 60), ...state.names.axes.map((_, i) => points.map((p) => p.rates_dph[i] ?? null))];
    figure("rate", data, state.names.axes.map((axis, i) => ({ label: "axis " + axis, stroke: colour(i) })), { x: "min", y: "°/h" });
  };
  const drawTemperature = () => {
    // What the means do not reach yet comes second by second.
    const last = state.means.length ? state.means[state.means.length - 1].t_s : -1;
    const points = state.means.concat(state.seconds.filter((p) => p.t_s > last));
    const data = [points.map((p) => p.t_s / 3600), ...state.names.thermometers.map((_, i) => points.map((p) => p.temperatures_c[i] ?? null))];
    figure("temperature", data, state.names.thermometers.map((name, i) => ({ label: name, stroke: colour(i) })), { x: "h", y: "°C" });
  };
  const drawFit = () => {
    const study = state.study;
    const words = study.axes.map((a) => `axis ${a.axis}: ${a.model}; residual σ ${figures3(a.residual_dph)} °/h` + (a.floor_dph ? `, noise floor ${figures3(a.floor_dph)} °/h` : ""));
    put("fit-words", study.axes.length ? `${words.join("; ")}; after ${long(study.recorded_s)}` : (study.refused ? "No fit yet: " + study.refused : "No fit yet."));
    if (!study.axes.length) return;
    // Each axis has its own temperatures: one x for all, nulls elsewhere.
    const all = study.axes.flatMap((a, i) => a.residuals.map((r) => [r.temperature_c, i, r.after_dph]));
    all.sort((p, q) => p[0] - q[0]);
    const data = [all.map((p) => p[0]), ...study.axes.map((_, i) => all.map((p) => (p[1] === i ? p[2] : null)))];
    figure("residual", data, study.axes.map((a, i) => ({ label: `axis ${a.axis}, windows`, stroke: colour(i), dots: true })), { x: "°C", y: "°/h" });
    const first = study.axes[0].curve.map((c) => c.temperature_c);
    const known = study.axes.map((a) => a.curve.map((c) => c.half_dph));
    const series = study.axes.map((a, i) => ({ label: `axis ${a.axis}`, stroke: colour(i) }));
    const asked = state.share_dph;
    if (asked) {
      known.push(first.map(() => asked));
      series.push({ label: `${figures3(asked)} °/h of ${state.share_of}`, stroke: css("bad"), dash: [6, 4] });
    }
    figure("known", [first, ...known], series, { x: "°C", y: "°/h" });
  };
  const drawAllan = () => {
    const curves = state.study.allan.filter(([, curve]) => curve.length > 1);
    if (!curves.length) return;
    const taus = [...new Set(curves.flatMap(([, curve]) => curve.map((p) => p.tau_s)))].sort((a, b) => a - b);
    const of = (curve) => { const by = new Map(curve.map((p) => [p.tau_s, p.adev_dph])); return taus.map((t) => { const v = by.get(t); return v > 0 ? v : null; }); };
    figure("allan", [taus, ...curves.map(([, curve]) => of(curve))], curves.map(([axis], i) => ({ label: "axis " + axis, stroke: colour(i) })), { x: "τ, s", y: "°/h", log: true });
  };

  // Words -----------------------------------------------------------------------------------------------------------------
  const tile = (name, value, unit) => {
    const box = document.createElement("div");
    box.className = "tile";
    for (const [kind, text] of [["name", name], ["number", value], ["unit", unit]]) {
      const div = document.createElement("div");
      div.className = kind;
      div.textContent = text;
      box.append(div);
    }
    return box;
  };
  const drawNow = () => {
    const now = state.now, tiles = [];
    state.names.axes.forEach((axis, i) => tiles.push(tile("rate, axis " + axis, figures3(now.rates_dph[i]), "°/h")));
    state.names.thermometers.forEach((name, i) => {
      const rate = now.temperature_rates_cpm[i];
      tiles.push(tile(name, figures3(now.temperatures_c[i]), "°C" + (rate === null || rate === undefined ? "" : `, ${figures3(rate)} °C/min`)));
    });
    tiles.push(tile("recorded", long(now.t_s), `${state.counts.rows} rows`));
    const drift = state.clock.drift_ppm;
    // A replay has no clock of its own.
    if (state.clock.jitter_s > 0) tiles.push(tile("jitter of arrival", figures3(1000 * state.clock.jitter_s), "ms" + (drift === null ? "" : `, clock ${figures3(drift)} ppm`)));
    const celsius = now.temperatures_c.find((value) => value !== null && value !== undefined);
    put("temperature", celsius === undefined ? "–" : `${celsius.toFixed(1).replace("-", "−")} °C`);
    at("tiles").replaceChildren(...tiles);
    at("sources").tBodies[0].replaceChildren(...state.sources.map((s) => row(
      cell(s.name, "words"), cell(s.state + (s.state === "lost" ? ": " + s.why : ""), "state-" + s.state),
      cell(s.ago_s === null ? "–" : s.ago_s.toFixed(1)), cell(String(s.bytes)))));
  };
  // A replay has no clock of its own: it has hours to go, and no time of day.
  const endTime = (enough) => {
    if (state.ended || state.failed || !enough) return "";
    if (enough.met) return "end it now";
    if (enough.hours_to_go === null) return "end not known yet";
    const left = `${long(3600 * enough.hours_to_go)} to go`;
    const end = new Date(Date.now() + 3.6e6 * enough.hours_to_go);
    return state.clock.jitter_s > 0 ? `ends about ${end.toTimeString().slice(0, 5)}, ${left}` : left;
  };
  const drawVerdict = () => {
    const study = state.study, enough = study.enough;
    const box = at("verdict");
    box.className = "verdict" + (enough && enough.met ? " pass" : "");
    if (state.failed) {
      box.className = "verdict fail";
      put("verdict-word", "Rows cannot be read");
      put("verdict-text", state.failed);
    } else if (state.ended) {
      put("verdict-word", "The recording has ended");
      put("verdict-text", "");
    } else if (!enough) {
      put("verdict-word", "Recording");
      put("verdict-text", study.axes.length ? "No limits are asked (--limits), so the page cannot tell whether the test is complete." : (study.refused || ""));
    } else {
      put("verdict-word", enough.met ? "The test is complete" : "Keep testing");
      const hours = enough.hours_to_go;
      const next = enough.axes.map((a) => a.next).find((n) => n);
      const to = next ? (Math.abs(next.from_c - next.to_c) < 0.5 ? `a soak at ${degrees(next.to_c)} °C` : `a ramp from ${degrees(next.from_c)} to ${degrees(next.to_c)} °C`) : "";
      const probability = Math.min(...enough.axes.map((a) => a.probability));
      put("verdict-text", `probability ${isFinite(probability) ? probability.toFixed(2) + " if the model is right" : "–"}`
        + (enough.met ? "" : hours === null ? "; hours to go are not known" : "")
        + (next && !enough.met ? `; worth most now: ${to} for ${next.hours.toFixed(1)} h` : ""));
    }
    put("end-time", endTime(enough));
    at("open").replaceChildren(...(enough ? enough.open : []).map((text) => item(text)));
    const limits = enough ? enough.axes.flatMap((a) => a.expected.map((e) => row(cell(a.axis), cell(e.limit, "words"), cell(`${figures3(e.bound)} ${unit(e.unit)}`), cell(figures3(e.value_95))))) : [];
    at("limits-section").hidden = !limits.length;
    at("limits").tBodies[0].replaceChildren(...limits);
    const later = enough && enough.not_decided.length ? ["Decided by a retest: " + enough.not_decided.join(", ")] : [];
    const unseen = (enough ? enough.not_seen : []).map((text) => "Not seen by this test: " + text);
    put("not-decided", unseen.concat(later).join(". "));
  };
  const drawEvents = () => {
    const when = (ns) => new Date(ns / 1e6).toISOString().slice(0, 19).replace("T", " ") + " UTC";
    at("events").replaceChildren(...state.events.slice().reverse().map((e) => item(when(e.at_ns) + "  " + e.what)));
    at("warnings").replaceChildren(...state.warnings.slice(0, 20).map((w) => {
      const li = item("", w.until_s === null ? "" : "over");
      const b = document.createElement("b");
      b.textContent = w.words;
      li.append(b, `since ${long(w.since_s)} of the test` + (w.until_s === null ? "" : `, over at ${long(w.until_s)}`));
      return li;
    }));
    const holding = state.warnings.filter((w) => w.until_s === null).length;
    document.title = (holding ? `(${holding}) ` : "") + (state.title || "Sagnac bench");
  };
  const drawAll = () => {
    put("title", state.title);
    put("subtitle", state.subtitle);
    drawNow(); drawVerdict(); drawEvents(); drawRate(); drawTemperature(); drawFit(); drawAllan();
    at("control").hidden = !state.may_stop || state.ended;
  };

  // The line to the bench -------------------------------------------------------------------------------------------------
  const line = (text, bad) => { put("link", text); at("link").className = bad ? "bad" : ""; };
  const load = async () => {
    const answer = await fetch("state.json", { cache: "no-store" });
    if (!answer.ok) throw new Error(String(answer.status));
    state = await answer.json();
    drawAll();
  };
  const listen = () => {
    if (source) source.close();
    source = new EventSource("events");
    source.onopen = () => load().then(() => { heard = Date.now(); line("live"); }, () => line("the bench does not answer", true));
    source.onerror = () => {
      line("no connection to the bench: this page goes on by itself as soon as it is back", true);
      // A browser gives up after some answers; then it is asked again.
      if (source.readyState === EventSource.CLOSED) setTimeout(listen, 1000);
    };
    source.addEventListener("now", (e) => {
      heard = Date.now();
      if (!state) return;
      const came = JSON.parse(e.data);
      const points = came.points;
      delete came.points;
      Object.assign(state, came);
      const last = state.seconds.length ? state.seconds[state.seconds.length - 1].t_s : -1;
      const all = state.seconds.concat(points.filter((p) => p.t_s > last));
      const from = all.length ? all[all.length - 1].t_s - 600 : 0;
      state.seconds = all.filter((p) => p.t_s > from).slice(-600);
      // The means of the whole come with the state; they are fetched before the seconds no longer reach back to them.
      const end = state.means.length ? state.means[state.means.length - 1].t_s : 0;
      const gap = state.seconds.length ? state.seconds[0].t_s - end : 0;
      if (gap > 30 && !loading) { loading = true; load().finally(() => { loading = false; }); }
      line("live");
      drawNow(); drawRate(); drawTemperature(); drawVerdict();
    });
    source.addEventListener("study", (e) => { if (state) { Object.assign(state, JSON.parse(e.data)); drawVerdict(); drawFit(); drawAllan(); } });
    source.addEventListener("events", (e) => { if (state) { Object.assign(state, JSON.parse(e.data)); drawEvents(); } });
    source.addEventListener("lost", () => load());
  };
  setInterval(() => { if (heard && Date.now() - heard > 5000 && source.readyState === EventSource.OPEN) line("nothing came for " + Math.round((Date.now() - heard) / 1000) + " s", true); }, 1000);

  // Keys and size ---------------------------------------------------------------------------------------------------------
  const dark = (on) => { root.className = on ? "dark" : "light"; try { localStorage.setItem("sagnac-dark", on ? "1" : "0"); } catch { /* a private window */ } if (state) drawAll(); };
  let wanted = null;
  try { wanted = localStorage.getItem("sagnac-dark"); } catch { /* a private window */ }
  root.className = (wanted === null ? matchMedia("(prefers-color-scheme: dark)").matches : wanted === "1") ? "dark" : "light";
  addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const names = Object.keys(figures), number = Number(e.key);
    const show = (id) => { const box = at(id); box.scrollIntoView({ block: "center" }); (box.querySelector(".plot") || box).focus(); };
    if (number >= 1 && number <= names.length) show("figure-" + names[number - 1]);
    else if (e.key === "e") at("events").scrollIntoView({ block: "center" });
    else if (e.key === "w") at("warnings").scrollIntoView({ block: "center" });
    else if (e.key === "d") dark(root.className !== "dark");
    else if (e.key === "Escape") Object.values(figures).forEach((f) => f && f.plot.setData(f.plot.data, true));
  });
  let resized = 0;
  addEventListener("resize", () => { clearTimeout(resized); resized = setTimeout(() => { for (const [name, f] of Object.entries(figures)) if (f) f.plot.setSize({ width: Math.max(280, at("figure-" + name).querySelector(".plot").clientWidth), height: innerWidth < 600 ? 200 : 260 }); }, 150); });
  at("stop").addEventListener("click", async () => {
    if (!confirm("End the recording?")) return;
    const answer = await fetch("stop", { method: "POST" });
    line(answer.ok ? "the recording is being ended" : "the bench refuses: " + answer.status, !answer.ok);
  });
  listen();
})();
