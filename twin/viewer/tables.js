// Tables: values at the cursors and statistics, metrics and verdicts with reference values, events.

const digits = (value) => (value === null || value === undefined ? "–" : String(+value.toPrecision(6)));
const STATISTICS = [["mean", "mean"], ["std", "std"], ["rms", "RMS"], ["low", "min"], ["high", "max"], ["peak_to_peak", "peak to peak"]];
const SHORT = 150, PAIRED = 2e6; // shortest time between requests of values [ms]; samples of a case from which on it is not compared with that of run A

// request values for what is shown now, again if it changes meanwhile
async function tabulate() {
  tabulate.stale = true;
  if (tabulate.busy) return;
  tabulate.busy = true;
  while (tabulate.stale) {
    await new Promise((done) => setTimeout(done, playing ? SHORT / 4 : SHORT));
    tabulate.stale = false;
    try { await summarize(); } catch { /* the chart says what is wrong */ }
  }
  tabulate.busy = false;
}

// the window that is summarized: between the cursors, or what is visible
const isBetween = () => state.cursors.length === 2 && state.cursors[0] !== state.cursors[1];
const summarized = () => (isBetween() ? [...state.cursors].sort((a, b) => a - b) : windowOf());

async function summarize() {
  if (!find("values").open && about.runs.length < 2) return;
  const lines = [...curves.values()].filter((line) => line.spec.kind === "time" && !chart.dimmed.has(line.name)), window = summarized();
  const times = [...state.cursors, ...(state.time === null ? [] : [state.time])], own = (line, list) => list.map((time) => time - offset(line.spec.case));
  const pairs = about.runs.length < 2 ? [] : lines.flatMap((line, k) => { const found = line.item.minus === null && about.cases[line.spec.case].samples < PAIRED && curveOf({ kind: "time" }, { ...line.item, minus: about.runs[0].letter }, line); return found ? [[k, found]] : []; });
  const specs = [...lines.map((line) => [line, line.spec]), ...pairs.map(([k, { spec }]) => [lines[k], spec])].map(([line, spec]) => ({ ...spec, window: own(line, window) }));
  const key = JSON.stringify([specs, lines.map((line) => about.cases[line.spec.case].samples)]); // statistics do not depend on the time cursor
  const statistics = key === summarize.key ? summarize.statistics : await statisticsOf(specs);
  Object.assign(summarize, { key, statistics });
  distances.clear();
  pairs.forEach(([k, { cases: { length: common } }], p) => {
    const { count, low, high } = statistics[lines.length + p], far = Math.max(Math.abs(low), Math.abs(high)), { spec, cases, name, pane: { unit } } = lines[k];
    const all = about.cases.filter(({ run, variant }) => !run && variant === about.cases[spec.case].variant).length, isPart = common < Math.max(all, cases.length);
    if (count) distances.set(name, `(${far === 0 && (isPart || count === statistics[k].count) ? "equal to A" : `A ± ${number(far, 0)} ${unit}`}${isPart ? ` in ${common} seed${common > 1 ? "s" : ""}` : ""})`);
  });
  chart.redraw(false);
  if (!find("values").open) return;
  const values = times.length ? await source.values(specs.slice(0, lines.length), lines.map((line) => own(line, times))) : [];
  const seeds = specs.some((spec) => spec.seeds?.length) ? "; seeds: min and max of all, otherwise the mean over seeds" : "";
  find("summarized").textContent = (isBetween() ? "between the cursors" : state.window ? "of the visible time" : "of the whole time") + seeds;
  find("values").querySelector("div").replaceChildren(valueTable(lines, values, statistics));
}

// statistics of curves; seeds are evaluated one by one, as in metrics: the mean curve would hide their noise
async function statisticsOf(specs) {
  const parts = specs.map((spec) => (spec.seeds?.length ? spec.seeds.map((number, k) => ({ ...spec, case: number, minus: spec.partners[k] ?? null, seeds: [], partners: [] })) : [spec]));
  const found = await source.statistics(parts.flat());
  return parts.map((own) => overSeeds(found.splice(0, own.length)));
}

function overSeeds(parts) {
  const own = parts.filter((one) => one.count), [first] = own;
  if (own.length < 2) return first ?? parts[0];
  const mean = (name) => (own.every((one) => Number.isFinite(one[name])) ? own.reduce((sum, one) => sum + one[name], 0) / own.length : null);
  const low = Math.min(...own.map((one) => one.low)), high = Math.max(...own.map((one) => one.high)), means = ["mean", "std", "rms", "peak_to_peak", "slope", "rate"].map((name) => [name, mean(name)]);
  return { ...first, ...Object.fromEntries(means), count: own.reduce((sum, one) => sum + one.count, 0), low, high, thinned: own.some((one) => one.thinned) };
}

function valueTable(lines, values, statistics) {
  const table = element("table", ""), [from, to] = windowOf(), [a, b] = state.cursors, both = b !== undefined, second = (value) => `${readableTime(value, from, to)} s`;
  const row = (cells, tag = "td") => { const made = table.insertRow(); cells.forEach((text) => made.append(element(tag, text))); return made; };
  const cursors = [...(a === undefined ? [] : ["A"]), ...(both ? ["B", "B − A"] : []), ...(state.time === null ? [] : ["now"])];
  row(["", ...cursors.map((name) => name.replace(/^[AB]$/, "at $&")), ...STATISTICS.map(([, title]) => title), "slope [1/s]", "rate [Hz]"], "th");
  if (cursors.length) {
    const found = { A: a, B: b, "B − A": b - a, now: state.time }, made = row(["time", ...cursors.map((name) => second(found[name])), ...Array(STATISTICS.length + 2).fill("")]);
    if (both && a !== b) {
      Object.assign(made.cells[cursors.length + 1], { textContent: `1 / (B − A): ${number(1 / Math.abs(b - a), 0)} Hz`, colSpan: 3 });
      made.deleteCell(-1);
      made.deleteCell(-1);
    }
  }
  const entries = lines.map((line, k) => {
    const [first, second] = values[k] || [];
    return { line, ...statistics[k], A: first, B: second, "B − A": Number.isFinite(first) && Number.isFinite(second) ? second - first : null, now: values[k]?.[state.cursors.length] };
  });
  for (const place of new Set(lines.map((line) => line.place))) paneRows(entries.filter(({ line }) => line.place === place), cursors, row);
  return table;
}

// the rows of the curves of a pane, or of the panes into which it is split: each column has one precision
function paneRows(entries, cursors, row) {
  const [from, to] = summarized(), { unit } = entries[0].line.pane;
  const step = resolution(entries);
  const columns = [...[...cursors, ...STATISTICS.map(([name]) => name)].map((name) => [name, step]), ["slope", 10 * step / (to - from)], ["rate", 0]];
  const texts = columns.map(([name, own]) => columnTexts(entries.map((each) => each[name]), own));
  entries.forEach(({ line, count, thinned }, k) => {
    if (line.pane !== entries[k - 1]?.line.pane) row([`${line.pane.title}${unit ? ` [${unit}]` : ""}`], "th").firstChild.colSpan = 4;
    const made = row(["", ...texts.map((column) => column[k])]);
    made.firstChild.append(swatch(line), line.label.replace(SEEDS, ""));
    made.title = `${line.label}: ${line.about}; ${(count ?? 0).toLocaleString("en-US")} ${thinned ? "extremes of its samples: mean, std and RMS with twin view" : "samples"}`;
  });
}

// what a screen can show of the smallest range of several curves, at most a part of the largest value; 0 if all are constant
function resolution(entries) {
  const ranges = entries.map((each) => each.peak_to_peak).filter((range) => range > 0), largest = Math.max(...entries.flatMap(({ low, high }) => [low, high]).filter(Number.isFinite).map(Math.abs), 0);
  return ranges.length ? Math.max(Math.min(...ranges) / 500, largest * 1e-5) : 0;
}

// numbers with the digits of a step, all as powers of ten if they are very large or small; without a step: four significant digits
function columnTexts(values, step) {
  const sizes = values.filter((value) => Number.isFinite(value) && value !== 0).map(Math.abs), largest = Math.max(...sizes, 0), decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const text = !(step > 0) ? (value) => number(value, 0) : largest >= 1e7 || (largest && largest < 1e-5) ? (value) => value.toExponential(3).replace("e+", "e") : (value) => (Math.round(value * 10 ** decimals) === 0 ? 0 : value).toFixed(Math.min(decimals, 12));
  return values.map((value) => (value === 0 ? "0" : Number.isFinite(value) ? text(value) : "–"));
}

// ---- metrics and verdicts

function badge(verdict) { return element("b", { pass: "pass", fail: "FAIL", none: "none", open: "open", skipped: "skipped" }[verdict] ?? "", { className: verdict }); }

// what several runs have in common: entries of the same name, of each run at most one; the number of a repeated name counts
function byName(entries, nameOf) {
  const groups = new Map(), counts = new Map();
  for (const one of entries) {
    const name = nameOf(one), count = counts.get(`${one.run} ${name}`) ?? 0, key = `${count} ${name}`;
    counts.set(`${one.run} ${name}`, count + 1);
    groups.set(key, [...(groups.get(key) ?? []), one]);
  }
  return [...groups.values()].map((own) => own.sort((a, b) => a.run - b.run));
}

// a text for each run
const perRun = (textOf) => (about.runs.length < 2 ? textOf(0) : about.runs.map(({ letter: run }, r) => `${run}: ${textOf(r)}`).join("; "));

function expectations() {
  const box = find("expectations"), isFolded = !box.querySelector("details[open]"), several = about.runs.length > 1;
  const isSkipped = (own) => own.every(({ verdict }) => verdict === "skipped"), groups = byName(about.expectations, ({ name }) => name), problem = about.runs.map((run) => run.problem).filter(Boolean);
  const rowOf = (own) => {
    const [one] = [...own].sort((a, b) => (b.verdict === "fail") - (a.verdict === "fail")), label = element("span", ""), badges = element("div", "");
    const found = button("", () => goTo(one), { className: "outcome", disabled: !one.signal || !nameInPage(one.signal) }), detailsOf = (some) => some.map(({ run, detail }) => `${several ? `${about.runs[run].letter}: ` : ""}${detail}`).join(" ");
    badges.append(...(several ? about.runs.flatMap(({ letter: run }, r) => [`${run} `, badge(own.find((each) => each.run === r)?.verdict), element("br", "")]) : [badge(one.verdict)]));
    const small = detailsOf(several ? own.filter(({ verdict }) => verdict === "fail") : own);
    found.title = detailsOf(own);
    label.append(element("b", one.name), " ", element("small", small === one.name ? "" : small));
    found.append(badges, label);
    found.classList.toggle("bad", one.verdict === "fail");
    return found;
  };
  const summary = (r) => {
    const own = about.expectations.filter(({ run }) => run === r), count = (verdict) => own.filter((one) => one.verdict === verdict).length, failed = count("fail"), skipped = count("skipped"), judged = own.length - skipped;
    return own.length && count("open") === own.length ? `${own.length}, judged at the end` : (failed ? `${failed} of ${judged} failed` : `${judged}, none failed`) + (skipped ? `, ${skipped} not judged` : "");
  };
  const skipped = groups.filter(isSkipped), rest = element("details", "", { open: !isFolded });
  rest.append(element("summary", `not judged (${skipped.length})`), ...skipped.map(rowOf));
  box.hidden = !groups.length && !problem.length;
  box.querySelector("summary").textContent = `Requirements: ${perRun(summary)}`;
  box.querySelector("div").replaceChildren(...problem.map((text) => element("p", text, { className: "twin-soft" })), ...groups.filter((own) => !isSkipped(own)).map(rowOf), ...(skipped.length ? [rest] : []));
}

const referenced = (own) => own.flatMap(({ rows }) => rows).filter((row) => row.reference !== null), compared = (own) => referenced(own).filter(({ verdict }) => verdict === "pass" || verdict === "fail");

// the difference of two numbers, with their digits
function difference(a, b) {
  const value = Number(b ?? NaN) - Number(a ?? NaN), places = (text) => /\.(\d+)$/.exec(text)?.[1].length ?? 0;
  return !Number.isFinite(value) ? "–" : /e/.test(a + b) ? number(value, 0) : value.toFixed(Math.max(places(a), places(b))).replace(/^-(?=[0.]*$)/, "");
}

// metrics of all runs with the paper's values; those of shown variants are marked
function metrics() {
  const box = find("metrics"), shown = new Set(state.cases.map((k) => about.cases[k].variant)), several = about.runs.length > 1, isPair = about.runs.length === 2;
  box.hidden = !about.metrics.length;
  box.querySelector("summary").textContent = `Metrics: ${perRun((r) => {
    const own = about.metrics.filter(({ run }) => run === r), judged = compared(own), all = referenced(own);
    return judged.length ? `${judged.filter(({ verdict }) => verdict === "pass").length} of ${judged.length} as in the paper` : all.length ? `${all.length} compared, ${all.some(({ verdict }) => verdict === "other") ? "settings differ from the paper's" : "no tolerance given"}` : `${own.length}`;
  })}`;
  box.querySelector("div").replaceChildren(...byName(about.metrics, ({ name, unit }) => `${name} ${unit}`).map((own) => {
    const [one] = own, found = element("div", "", { className: "metric" }), table = element("table", ""), reference = referenced(own).length > 0;
    found.append(button(`${one.description || one.name}${one.unit ? ` [${one.unit}]` : ""}`, () => goTo({ ...one, spans: {} }), { className: "name", title: `${one.name}: ${one.definition}`, disabled: !one.signal || !nameInPage(one.signal) }), table);
    const head = table.insertRow(), titles = [...(several ? about.runs.map((run) => run.letter) : reference ? ["twin"] : []), ...(isPair ? ["B − A"] : []), ...(reference ? ["paper"] : []), ...(reference && !several ? [compared(own).length ? one.tolerance ?? "" : ""] : [])];
    if (titles.length) ["", ...titles].forEach((text) => head.append(element("th", text)));
    for (const variant of new Set(own.flatMap(({ rows }) => rows.map((row) => row.variant)))) {
      const made = table.insertRow(), rows = about.runs.map((_, r) => own.find(({ run }) => run === r)?.rows.find((row) => row.variant === variant));
      made.classList.toggle("twin-soft", !shown.has(variant));
      made.insertCell().textContent = variant;
      for (const row of rows) {
        const cell = made.insertCell();
        cell.append(row?.value ?? "–", " ");
        if (row?.range) Object.assign(cell, { title: `seeds: ${row.range}` });
        if (several && row) cell.append(badge(row.verdict)); else if (row?.range) cell.append(element("small", row.range));
      }
      if (isPair) made.insertCell().textContent = difference(...rows.map((row) => row?.value));
      if (reference) made.insertCell().textContent = rows.find((row) => row?.reference)?.reference ?? "";
      if (!several) made.insertCell().append(badge(rows[0].verdict));
    }
    return found;
  }));
}

// show the signal of an expectation or a metric, in its window; of a failed expectation, its first failed span
function goTo(one) {
  const name = nameInPage(one.signal);
  const variants = one.variants?.length ? one.variants : undefined; // those that are judged
  let place = state.panes.findIndex((each) => each.kind === "time" && (!variants || String(each.variants) === String(variants)) && each.items.some((item) => item.minus === null && (item.signal === name || heads.get(item.signal)?.key === one.signal)));
  if (place < 0) { place = 0; state.panes.unshift(pane([name], { variants })); }
  if (variants && !state.cases.some((k) => about.cases[k].run === one.run && variants.includes(about.cases[k].variant)))
    state.cases = [...state.cases, ...about.cases.flatMap((each, k) => (each.run === one.run && variants.includes(each.variant) ? [k] : []))];
  const bad = Object.keys(one.spans).map(Number), [low, high] = extentOf(), move = state.offsets[one.run];
  if (bad.length) {
    if (!bad.some((k) => state.cases.includes(k))) state.cases = [...state.cases, bad[0]];
    state.window = windowOfFailure(one, state);
  } else state.window = one.begin === null && one.end === null ? null : [(one.begin ?? low - move) + move, (one.end ?? high - move) + move];
  show();
  reveal(place);
}

function events() {
  const found = marks();
  find("events").hidden = !found.length;
  find("events").querySelector("summary").textContent = `Events: ${found.length}`;
  find("events").querySelector("div").replaceChildren(...found.map(({ at, text }) => {
    const row = button("", () => { const [low, high] = windowOf(), all = extentOf(), half = Math.min((high - low) / 2, (all[1] - all[0]) / 40 + (high - low) / 20); state.window = [at - half, at + half]; show(); }, { className: "outcome" });
    row.append(element("b", `${digits(at)} s`), element("span", text));
    return row;
  }));
}
find("values").ontoggle = () => tabulate();

// ---- a followed rig

function following() {
  const known = about.following, box = find("following"), lost = find("lost");
  box.hidden = !known;
  document.body.classList.toggle("followed", !!known);
  lost.hidden = !known?.lost;
  if (!known) return;
  lost.replaceChildren(element("b", known.lost), ` ${known.reason}${known.since === null ? "" : ` Since ${digits(known.since)} s.`}`);
  const table = element("table", ""), row = (name, text) => { const made = table.insertRow(); made.append(element("td", name), element("td", text)); };
  for (const [name, { text }] of Object.entries(known.estimates)) row(name, text);
  row("NIS in its 95 % band", known.nis_in_band === null ? "–" : `${Math.round(100 * known.nis_in_band)} % lately`);
  for (const [name, { chance, limits, unit }] of Object.entries(known.forecast?.signals || {})) if (limits.length && chance !== null) row(`${name} leaves ${limits.map(digits).join(" to ")} ${unit} within ${digits(known.forecast.time.at(-1) - known.forecast.start)} s`, `${Math.round(100 * chance)} %`);
  const alarms = known.changes.map(({ name, onset, time, probability }) => {
    const found = button("", () => { const [from, to] = extentOf(), half = Math.max(2 * (time - onset), (to - from) / 20); state.window = [onset - half, onset + half]; show(); }, { className: "outcome bad", title: "Show the time of onset" });
    const label = element("span", "");
    label.append(element("b", name), ` since ${onset.toFixed(1)} s, noticed at ${time.toFixed(1)} s with ${(100 * probability).toFixed(1)} %`);
    found.append(element("b", `${onset.toFixed(1)} s`), label);
    return found;
  });
  const count = known.changes.length, alarmed = count ? `, ${count} change${count > 1 ? "s" : ""}` : "";
  box.querySelector("summary").textContent = `Following: ${known.lost ? "does not represent" : "represents"} the rig${alarmed}`;
  box.querySelector("div").replaceChildren(table, ...(alarms.length || !known.looks_for_changes ? alarms : [element("p", "No change was noticed.", { className: "twin-soft" })]));
}
