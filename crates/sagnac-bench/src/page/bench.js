// The page of a running test. Everything that comes from a log is put in as text, never as markup.
(() => {
  "use strict";
  const at = (id) => document.getElementById(id);
  const root = document.documentElement;
  const css = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();
  const palette = ["after", "before", "floor", "excluded", "accent", "temperature"];
  const colour = (i) => css(palette[i % palette.length]);
  const figures = { rate: null, temperature: null, residual: null, known: null, allan: null };
  let state = null, source = null, heard = 0, loading = false, lost = "", ended_at = null;

  const figures3 = (value) => {
    if (value === null || value === undefined || !isFinite(value)) return "–";
    const size = Math.abs(value);
    const text = size !== 0 && (size < 1e-3 || size >= 1e6) ? value.toExponential(2) : value.toPrecision(size >= 100 ? Math.min(7, Math.ceil(Math.log10(size)) + 1) : 3);
    return text.replace("-", "−");
  };
  const degrees = (celsius) => String(Math.round(celsius)).replace("-", "−");
  // Rates come in °/h and are shown in the unit that was asked for.
  const ofDph = (dph) => (dph === null || dph === undefined ? dph : dph / state.dph_per_unit);
  const withUnit = (value, text) => {
    const own = text.replaceAll("degC", "°C").replaceAll("deg/", "°/");
    return own.startsWith("°/h") ? `${figures3(ofDph(value))} ${state.units}${own.slice(3)}` : `${figures3(value)} ${own}`;
  };
  const long = (seconds) => {
    if (seconds < 120) return Math.round(seconds) + " s";
    if (seconds < 7200) return Math.round(seconds / 60) + " min";
    return (seconds / 3600).toFixed(1) + " h";
  };
  // Backticks are for a console.
  const plain = (text) => text.replaceAll("`", "");
  const put = (id, words) => { const e = at(id), text = plain(words); if (e.textContent !== text) e.textContent = text; };
  const cell = (text, name) => { const td = document.createElement("td"); td.textContent = plain(text); if (name) td.className = name; return td; };
  // On a phone a row is a list: each value has its name.
  const named = (name, text, kind) => { const td = cell(text, kind); td.dataset.name = name; return td; };
  const row = (...cells) => { const tr = document.createElement("tr"); tr.append(...cells); return tr; };
  const item = (text, name) => { const li = document.createElement("li"); li.textContent = plain(text); if (name) li.className = name; return li; };

  // Figures ---------------------------------------------------------------------------------------------------------------
  // A bound lies over the plot as a line with its value.
  const bounded = (bound) => (u) => {
    const line = document.createElement("div"), words = document.createElement("span");
    line.className = "bound";
    words.textContent = `bound ${figures3(bound)} ${state.units}`;
    line.append(words);
    u.over.append(line);
    u.hooks.draw = [() => {
      const y = u.valToPos(bound, "y");
      line.style.top = y + "px";
      line.classList.toggle("top", y < 26);
    }];
  };
  const sizeOf = (box) => ({ width: box.clientWidth, height: innerWidth < 700 ? 200 : 260 });
  const figure = (name, data, series, options = {}) => {
    const box = at("figure-" + name).querySelector(".plot");
    const legend = at("figure-" + name).querySelector(".legend");
    const old = figures[name];
    if (!data[0].length) {
      if (old) old.plot.destroy();
      figures[name] = null;
      legend.replaceChildren();
      return;
    }
    const key = JSON.stringify([series.map((s) => [s.label, s.stroke]), options.bound, root.className]);
    if (old && old.key === key) {
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
    const number = new Intl.NumberFormat("en", { maximumSignificantDigits: 6 });
    const ticks = options.log ? {} : { values: (u, all) => all.map((v) => number.format(v).replace("-", "−")) };
    const bound = options.bound ?? null;
    const range = bound === null ? undefined : (u, lo, hi) => uPlot.rangeNum(Math.min(lo ?? 0, bound), Math.max(hi ?? bound, bound), 0.1, true);
    const plot = new uPlot({
      ...sizeOf(box),
      scales: { x: { time: false, distr: options.log ? 3 : 1 }, y: { distr: options.log ? 3 : 1, range } },
      axes: [axis(options.x, { size: 30, ...ticks }), axis(options.y, { size: 56, ...ticks })],
      cursor: { drag: { x: true, y: false } },
      legend: { show: false },
      hooks: { init: bound === null ? [] : [bounded(bound)] },
      series: [{}, ...series.map((s) => ({ label: s.label, stroke: s.stroke, width: s.dots ? 0 : 2, spanGaps: false,
        paths: s.dots ? () => null : undefined, points: { show: s.dots === true, size: 5, fill: s.stroke } }))],
    }, data, box);
    figures[name] = { key, plot };
  };

  const drawRate = () => {
    const points = state.seconds;
    const data = [points.map((p) => p.t_s / 60), ...state.names.axes.map((_, i) => points.map((p) => ofDph(p.rates_dph[i]) ?? null))];
    figure("rate", data, state.names.axes.map((axis, i) => ({ label: "axis " + axis, stroke: colour(i) })), { x: "min", y: state.units });
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
    const floor = (a) => (a.floor_dph ? `, noise floor ${figures3(ofDph(a.floor_dph))} ${state.units}` : "");
    const words = study.axes.map((a) => `Axis ${a.axis}: ${a.model}, residual σ ${figures3(ofDph(a.residual_dph))} ${state.units}${floor(a)}.`);
    put("fit-words", study.axes.length ? `${words.join(" ")} Fitted to the first ${long(study.recorded_s)}.` : "");
    if (!study.axes.length) return;
    // Each axis has its own temperatures: one x for all, nulls elsewhere.
    const all = study.axes.flatMap((a, i) => a.residuals.map((r) => [r.temperature_c, i, ofDph(r.after_dph)]));
    all.sort((p, q) => p[0] - q[0]);
    const data = [all.map((p) => p[0]), ...study.axes.map((_, i) => all.map((p) => (p[1] === i ? p[2] : null)))];
    figure("residual", data, study.axes.map((a, i) => ({ label: `axis ${a.axis}, windows`, stroke: colour(i), dots: true })), { x: "°C", y: state.units });
    const first = study.axes[0].curve.map((c) => c.temperature_c);
    const known = study.axes.map((a) => a.curve.map((c) => ofDph(c.half_dph)));
    const series = study.axes.map((a, i) => ({ label: `axis ${a.axis}`, stroke: colour(i) }));
    figure("known", [first, ...known], series, { x: "°C", y: state.units, bound: ofDph(state.share_dph) });
    put("known-words", `Half of the 95 % interval, ${state.units}.` + (state.share_of ? ` The bound is ${state.share_of}.` : ""));
  };
  const drawAllan = () => {
    const curves = state.study.allan.filter(([, curve]) => curve.length > 1);
    if (!curves.length) return;
    const taus = [...new Set(curves.flatMap(([, curve]) => curve.map((p) => p.tau_s)))].sort((a, b) => a - b);
    const of = (curve) => { const by = new Map(curve.map((p) => [p.tau_s, ofDph(p.adev_dph)])); return taus.map((t) => { const v = by.get(t); return v > 0 ? v : null; }); };
    figure("allan", [taus, ...curves.map(([, curve]) => of(curve))], curves.map(([axis], i) => ({ label: "axis " + axis, stroke: colour(i) })), { x: "τ, s", y: state.units, log: true });
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
    state.names.axes.forEach((axis, i) => tiles.push(tile("rate, axis " + axis, figures3(ofDph(now.rates_dph[i])), state.units)));
    const [first, ...others] = state.names.thermometers.map((name, i) => {
      const rate = now.temperature_rates_cpm[i] ?? null;
      return { name, celsius: now.temperatures_c[i] ?? null, rate: rate === null ? "" : `${rate > 0 ? "+" : ""}${figures3(rate)} °C/min` };
    });
    const words = ({ celsius }) => (celsius === null ? "–" : celsius.toFixed(1).replace("-", "−"));
    if (first) {
      put("temperature-name", first.name);
      put("temperature", words(first) + " °C");
      put("temperature-rate", first.rate);
    }
    others.forEach((other) => tiles.push(tile(other.name, words(other), "°C" + (other.rate && ", " + other.rate))));
    tiles.push(tile("recorded", long(now.t_s), `${state.counts.rows} rows`));
    const drift = state.clock.drift_ppm;
    // A replay has no clock of its own.
    if (state.clock.jitter_s > 0) tiles.push(tile("jitter of arrival", figures3(1000 * state.clock.jitter_s), "ms" + (drift === null ? "" : `, clock ${figures3(drift)} ppm`)));
    at("tiles").replaceChildren(...tiles);
    at("sources").tBodies[0].replaceChildren(...state.sources.map((s) => row(
      cell(s.name), named("state", s.state + (s.state === "lost" ? ": " + s.why : ""), "state-" + s.state),
      named("last byte", s.ago_s === null ? "–" : s.ago_s.toFixed(1) + " s ago"), named("recorded", s.bytes + " bytes"))));
  };
  // Seconds of the test until it is complete, less those since the fit that says so.
  const toGo = () => {
    const { enough, at_s } = state.study;
    if (!enough || enough.met || enough.hours_to_go === null) return null;
    return Math.max(0, 3600 * enough.hours_to_go - Math.max(0, state.now.t_s - at_s));
  };
  const clock = (ms) => {
    const time = new Date(ms), day = time.toDateString() === new Date().toDateString() ? "" : time.toLocaleDateString("en-GB", { weekday: "short" }) + " ";
    return day + time.toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" });
  };
  const badSources = () => (state.ended ? [] : state.sources.filter((s) => s.state === "silent" || s.state === "lost"));
  const holding = () => state.warnings.filter((w) => w.until_s === null).length + badSources().length;
  // The verdict, its reason, its colour. It is not green while a warning holds.
  const verdict = () => {
    const study = state.study, enough = study.enough, met = enough && enough.met;
    if (state.ended) return [enough ? `Ended: test ${met ? "" : "not "}complete` : "Recording ended", "", met && !holding() ? "pass" : ""];
    if (lost) return ["No connection to the bench", `These values are of ${clock(heard)}. ${lost}`, "fail"];
    if (state.failed) return ["Rows are unreadable", state.failed, "fail"];
    if (!state.names.axes.length) return ["No rows yet", state.events.length ? `The newest event is “${state.events[state.events.length - 1].what}”.` : "", ""];
    if (study.refused) return ["No verdict yet: no fit", study.refused, ""];
    if (!study.axes.length) return ["No verdict yet: no fit", "The first fit needs a minute of rows.", ""];
    if (!enough) return ["No verdict: no limits", "Restart with --limits and --resume: then this page says when the test is complete.", ""];
    const probability = Math.min(...enough.axes.map((a) => a.probability));
    const sure = isFinite(probability) ? `Probability that all limits are met, if the model is right: ${probability.toFixed(2)}.` : "";
    if (met && holding()) return ["Test complete, with a warning", `${sure} Look at the warning before you end the test.`, ""];
    if (met) return ["Test complete", sure, "pass"];
    const next = enough.axes.map((a) => a.next).find((n) => n), left = toGo();
    const to = (n) => (Math.abs(n.from_c - n.to_c) < 0.5 ? `soak at ${degrees(n.to_c)} °C` : `ramp from ${degrees(n.from_c)} to ${degrees(n.to_c)} °C`);
    return [left ? `About ${long(left)} to go` : "Keep testing", sure + (next ? ` Next: ${to(next)} for ${long(3600 * next.hours)}.` : ""), ""];
  };
  const drawEnd = () => {
    const left = toGo(), met = state.study.enough && state.study.enough.met;
    const [end, words] = state.ended ? [clock(ended_at), "ended"]
      : lost ? ["unknown", "no connection"]
      : met ? ["now", "the test is complete"]
      : !left ? ["unknown", ""]
      : state.is_replay ? [long(left), "of the replayed log"] : [clock(Date.now() + 1000 * left), "in " + long(left)];
    put("end", end);
    put("end-in", words);
  };
  const drawVerdict = () => {
    const enough = state.study.enough, [word, text, name] = verdict();
    if (state.ended) ended_at ??= Date.now();
    at("verdict").className = "verdict " + name;
    put("verdict-word", word);
    put("verdict-text", text);
    drawEnd();
    at("missing").hidden = !enough || !enough.open.length;
    at("open").replaceChildren(...(enough ? enough.open : []).map((text) => item(text)));
    const limits = enough ? enough.axes.flatMap((a) => a.expected.map((e) => row(cell(e.limit), named("axis", a.axis),
      named("error at 95 %", withUnit(e.value_95, e.unit)), named("bound", withUnit(e.bound, e.unit))))) : [];
    at("limits-section").hidden = !limits.length;
    at("limits").tBodies[0].replaceChildren(...limits);
    const later = enough && enough.not_decided.length ? ["Decided by a retest: " + enough.not_decided.join(", ")] : [];
    const unseen = (enough ? enough.not_seen : []).map((text) => "Not seen by this test: " + text);
    at("not-decided").replaceChildren(...unseen.concat(later).map((text) => item(text)));
  };
  const drawEvents = () => {
    const when = (ns) => new Date(ns / 1e6).toISOString().slice(0, 19).replace("T", " ") + " UTC";
    at("events").replaceChildren(...state.events.slice().reverse().map((e) => item(when(e.at_ns) + "  " + e.what)));
  };
  // A warning is the fault, then after a colon its cause or its remedy. Only the fault is large, and only while it holds.
  const warning = (words, more, holds) => {
    const li = item("", holds ? "" : "over"), fault = document.createElement("p");
    const [, what, why] = words.match(/^((?:axis .: )?[^]*?)(?:: ([^]*))?$/);
    fault.textContent = plain(what);
    fault.className = holds ? "far" : "";
    const sentence = (text) => text[0].toUpperCase() + text.slice(1) + ".";
    li.append(fault, [why, more].filter((text) => text).map(sentence).map(plain).join(" "));
    return li;
  };
  const drawWarnings = () => {
    const bad = badSources(), holds = holding();
    document.title = (holds ? `(${holds}) ` : "") + (state.title || "Sagnac bench");
    const all = bad.map((s) => [`${s.name} is ${s.state}`, s.why || "check its power and its cable", true]).concat(state.warnings.slice(0, 20).map((w) =>
      [w.words, `since ${long(w.since_s)} of the test` + (w.until_s === null ? "" : `, over at ${long(w.until_s)}`), w.until_s === null]));
    at("warnings").replaceChildren(...all.map((one) => warning(...one)));
  };
  const drawMoment = () => {
    drawNow(); drawVerdict(); drawWarnings(); drawRate(); drawTemperature();
    at("stop").hidden = !state.may_stop || state.ended;
  };
  const drawAll = () => {
    put("title", state.title);
    put("subtitle", state.subtitle);
    document.querySelectorAll(".rate-unit").forEach((e) => { e.textContent = state.units; });
    drawMoment(); drawEvents(); drawFit(); drawAllan();
  };

  // The line to the bench -------------------------------------------------------------------------------------------------
  const line = (text, bad) => {
    lost = bad || "";
    put("link", text);
    at("link").className = bad ? "bad" : "";
    at("stop").disabled = lost !== "";
    if (state) drawVerdict();
  };
  const load = async () => {
    const answer = await fetch("state.json", { cache: "no-store" });
    if (!answer.ok) throw new Error(String(answer.status));
    state = await answer.json();
    drawAll();
  };
  const listen = () => {
    if (source) source.close();
    source = new EventSource("events");
    source.onopen = () => load().then(() => { heard = Date.now(); line("live"); }, () => line("no connection", "The bench does not answer."));
    source.onerror = () => {
      if (state && state.ended) line("the bench has closed");
      else line("no connection", "This page continues by itself when the bench is back.");
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
      drawMoment();
    });
    source.addEventListener("study", (e) => { if (state) { Object.assign(state, JSON.parse(e.data)); drawVerdict(); drawFit(); drawAllan(); } });
    source.addEventListener("events", (e) => { if (state) { Object.assign(state, JSON.parse(e.data)); drawEvents(); drawVerdict(); drawWarnings(); } });
    source.addEventListener("lost", () => load());
  };
  setInterval(() => {
    if (heard && Date.now() - heard > 5000 && source.readyState === EventSource.OPEN) line("no news", `The last news came ${Math.round((Date.now() - heard) / 1000)} s ago.`);
  }, 1000);

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
  new ResizeObserver(() => { for (const f of Object.values(figures)) if (f) f.plot.setSize(sizeOf(f.plot.root.parentElement)); }).observe(at("figure-rate"));
  at("stop").addEventListener("click", async () => {
    if (!confirm("End the recording?")) return;
    const answer = await fetch("stop", { method: "POST" });
    put("link", answer.ok ? "the recording is ending" : `the bench refuses to end: ${answer.status}`);
  });
  listen();
})();
