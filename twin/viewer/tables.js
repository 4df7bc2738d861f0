// Tables: values at the cursors and statistics, metrics and verdicts with reference values, events.

const digits = (value) => (value === null || value === undefined ? "–" : String(+value.toPrecision(6)));
const STATISTICS = [["mean", "mean"], ["std", "std"], ["rms", "RMS"], ["low", "min"], ["high", "max"], ["peak_to_peak", "peak to peak"]];
const WORST = { low: "least", high: "largest", peak_to_peak: "largest" }; // of the seeds; other statistics are their means
const KINDS = { differs: "differs", fail: "failed", open: "open", pass: "passed", skipped: "not judged" }; // of requirements, in this order
const PASSES = 5; // at most, of requirements that are shown: more are folded
const SHORT = 150, PAIRED = 2e6; // shortest time between requests of values [ms]; samples of a case from which on it is not compared with that of run A

// request values for what is shown now, again if it changes meanwhile
async function tabulate() {
  tabulate.stale = true;
  outdated();
  if (tabulate.busy) return;
  tabulate.busy = true;
  while (tabulate.stale) {
    await new Promise((done) => setTimeout(done, SHORT));
    tabulate.stale = false;
    const now = tabulated();
    try { await summarize(); } catch { /* the chart says what is wrong */ }
    tabulate.summarized = now;
    outdated();
  }
  tabulate.busy = false;
}

// what the statistics depend on, so not the time cursor; until they follow, they are gray
const tabulated = () => JSON.stringify([state.panes, state.cases, state.window, state.cursors, state.offsets, state.band, [...chart.dimmed]]);
function outdated() { find("values").classList.toggle("outdated", tabulated() !== tabulate.summarized); }

// the window that is summarized: between the cursors, or what is visible
const isBetween = () => state.cursors.length === 2 && state.cursors[0] !== state.cursors[1];
const summarized = () => (isBetween() ? [...state.cursors].sort((a, b) => a - b) : windowOf());

async function summarize() {
  if (!find("values").open && about.runs.length < 2) return;
  const lines = [...curves.values()].filter((line) => line.spec.kind === "time" && !chart.dimmed.has(line.name)), window = summarized();
  const times = [...state.cursors, ...(state.time === null || playing ? [] : [state.time])], own = (line, list) => list.map((time) => time - offset(line.spec.case));
  const pairs = about.runs.length < 2 ? [] : lines.flatMap((line, k) => { const found = line.item.minus === null && about.cases[line.spec.case].samples < PAIRED && curveOf({ kind: "time" }, { ...line.item, minus: about.runs[0].letter }, line); return found ? [[k, found]] : []; });
  const specs = [...lines.map((line) => [line, line.spec]), ...pairs.map(([k, { spec }]) => [lines[k], spec])].map(([line, spec]) => ({ ...spec, window: own(line, window) }));
  const key = JSON.stringify([specs, lines.map((line) => about.cases[line.spec.case].samples)]); // statistics do not depend on the time cursor
  const statistics = key === summarize.key ? summarize.statistics : await statisticsOf(specs);
  Object.assign(summarize, { key, statistics });
  distances.clear();
  pairs.forEach(([k, { cases: { length: common } }], p) => {
    const { count, ranges, low = NaN, high = NaN } = statistics[lines.length + p], far = Math.max(Math.abs(ranges?.low[0] ?? low), Math.abs(ranges?.high[1] ?? high)), { spec, cases, name, pane: { unit } } = lines[k];
    const all = state.cases.filter((each) => !about.cases[each].run && about.cases[each].variant === about.cases[spec.case].variant).length, isPart = common < Math.max(all, cases.length);
    const where = shown.length > 2 ? "" : isBetween() ? " from t1 to t2" : state.window ? " in view" : "", [{ letter: first }] = about.runs;
    if (count) distances.set(name, `(${far === 0 && (isPart || count === statistics[k].count) ? `equal to ${first}` : `max |${about.runs[about.cases[spec.case].run].letter} − ${first}| ${number(+far.toPrecision(2), 0)} ${unit}`}${where}${isPart ? ` in ${common} seed${common > 1 ? "s" : ""}` : ""})`);
  });
  chart.redraw(false);
  if (!find("values").open) return;
  const values = times.length ? await source.values(specs.slice(0, lines.length), lines.map((line) => own(line, times))) : [];
  const seeds = specs.some((spec) => spec.seeds?.length) ? "; over seeds the mean, or what the column says (range: point at it)" : "";
  const [begin, end] = windowOf(), away = state.cursors.flatMap((at, k) => (at < begin || at > end ? [`t${k + 1}`] : [])).join(" and ");
  find("summarized").textContent = (isBetween() ? `between t1 and t2${away && ` (${away} outside of the visible time)`}` : state.window ? "of the visible time" : "of the whole time") + seeds + seedsNotHere();
  find("values").querySelector("div").replaceChildren(valueTable(lines, values, statistics));
  if (playing) refresh();
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
  const names = [...STATISTICS.map(([name]) => name), "slope", "rate"], ranges = Object.fromEntries(names.map((name) => [name, [Math.min, Math.max].map((edge) => edge(...own.map((one) => one[name])))]));
  const ofSeeds = (name) => (WORST[name] ? ranges[name][+(WORST[name] === "largest")] : mean(name)); // a mean of extremes would look better than the worst seed
  return { ...first, ...Object.fromEntries(names.map((name) => [name, ofSeeds(name)])), ranges, count: own.reduce((sum, one) => sum + one.count, 0), thinned: own.some((one) => one.thinned) };
}

function valueTable(lines, values, statistics) {
  const table = element("table", ""), [from, to] = windowOf(), [a, b] = state.cursors, both = b !== undefined, second = (value) => `${readableTime(value, from, to)} s`, isMerged = statistics.some(({ ranges }) => ranges);
  const row = (cells, tag = "td") => { const made = table.insertRow(); cells.forEach((text) => made.append(element(tag, text))); return made; };
  const cursors = [...(a === undefined ? [] : ["t1"]), ...(both ? ["t2", "t2 − t1"] : []), ...(state.time === null ? [] : ["now"])], times = { t1: a, t2: b, "t2 − t1": b - a, now: state.time };
  const head = [["", both && a !== b ? `1 / (t2 − t1): ${number(1 / Math.abs(b - a), 0)} Hz` : ""], ...cursors.map((name) => [name.replace(/^t.$/, "at $&"), second(times[name])]),
                ...STATISTICS.map(([name, title]) => [title, isMerged && WORST[name] ? `(${WORST[name]})` : ""]), ["slope", isMixed(lines) || !lines.length ? "" : slopeUnit(lines[0].pane.unit)], ["rate", "[Hz]"]];
  const made = row(head.map(([title]) => title), "th");
  head.forEach(([, text], k) => made.cells[k].append(element("small", text)));
  if (state.time !== null) made.cells[cursors.length].lastChild.now = () => second(state.time);
  const entries = lines.map((line, k) => {
    const [first, second] = values[k] || [];
    return { line, ...statistics[k], t1: first, t2: second, "t2 − t1": Number.isFinite(first) && Number.isFinite(second) ? second - first : null, now: values[k]?.[state.cursors.length] };
  });
  for (const place of new Set(lines.map((line) => line.place))) paneRows(entries.filter(({ line }) => line.place === place), cursors, row, isMixed(lines));
  return table;
}

// the unit of a slope is that of its pane per second; of different ones each pane has its own
const slopeUnit = (unit) => `[${unit || "1"}${/[ /]/.test(unit) ? " per s" : "/s"}]`;
const isMixed = (lines) => new Set(lines.map(({ pane: { unit } }) => unit)).size > 1;

// from when or until when a curve is there, if not in the whole window that is summarized
function partOf({ cases, spec }, count) {
  const [from, to] = summarized(), own = [...cases, ...(spec.minus === null ? [] : [spec.minus])], step = (to - from) / 1000, edge = (fold, side) => fold(...own.map((k) => about.cases[k][side] + offset(k)));
  const begin = edge(Math.max, "begin"), end = edge(spec.minus === null ? Math.max : Math.min, "end"), part = [...(begin > from + step ? [`from ${digits(begin)} s`] : []), ...(end < to - step ? [`to ${digits(end)} s`] : [])];
  return part.length && !about.growing ? `${part.join(" ")}, ${count ?? 0} samples` : "";
}

// the rows of the curves of a pane, or of the panes into which it is split: each column has one precision
function paneRows(entries, cursors, row, mixed) {
  const [from, to] = summarized(), { unit } = entries[0].line.pane;
  const step = resolution(entries), differ = new Set(entries.map(({ line }) => SEEDS.exec(line.label)?.[0])).size > 1;
  const columns = [...[...cursors, ...STATISTICS.map(([name]) => name)].map((name) => [name, step]), ["slope", 10 * step / (to - from)], ["rate", 0]];
  const texts = columns.map(([name, own]) => columnTexts(entries.map((each) => each[name]), own));
  entries.forEach(({ line, count, thinned, ranges }, k) => {
    if (line.pane !== entries[k - 1]?.line.pane) Object.assign(row([`${line.pane.title}${unit ? ` [${unit}]` : ""}`, ...Array(columns.length - 5).fill(""), mixed ? slopeUnit(unit) : "", ""], "th").firstChild, { colSpan: 4, pane: line.pane });
    const made = row(["", ...texts.map((column) => column[k])]);
    made.firstChild.append(swatch(line), differ ? line.label : line.label.replace(SEEDS, ""), element("small", partOf(line, count)));
    for (const [name, [low, high]] of Object.entries(ranges ?? {})) made.cells[1 + columns.findIndex(([own]) => own === name)].title = `seeds: ${digits(low)} to ${digits(high)}`;
    if (cursors.includes("now")) made.cells[cursors.length].now = () => columnTexts([valueAt({ ...(chart.data[line.name] ?? { x: [] }), head: { real: !line.step } }, state.time)], step)[0];
    made.title = `${line.label}: ${line.about}; ${(count ?? 0).toLocaleString("en-US")} ${thinned ? "extremes of its samples: mean, std and RMS with twin view" : "samples"}`;
  });
}

// the rows of the pane that is read come first
function bringRows(pane) {
  const heads = [...find("values").querySelectorAll("th")], title = heads.find((one) => one.pane === pane);
  if (title && bringRows.last !== pane) find("values").scrollTop += title.getBoundingClientRect().top - heads[0].getBoundingClientRect().bottom;
  if (title) bringRows.last = pane;
}

// while the time cursor moves, its column has the values of the drawn samples: a request would be late
function refresh() { if (state.time !== null) for (const cell of find("values").querySelectorAll("td, small")) if (cell.now) cell.textContent = cell.now(); }

// what a screen can show of the smallest range of several curves, at most a part of the largest value; 0 if all are constant
function resolution(entries) {
  const ranges = entries.map((each) => each.peak_to_peak).filter((range) => range > 0), largest = Math.max(...entries.flatMap(({ low, high }) => [low, high]).filter(Number.isFinite).map(Math.abs), 0);
  return ranges.length ? Math.max(Math.min(...ranges) / 200, largest * 1e-4) : 0;
}

// numbers with the digits of a step, all as powers of ten if they are very large or small; without a step: four significant digits
function columnTexts(values, step) {
  const sizes = values.filter((value) => Number.isFinite(value) && value !== 0).map(Math.abs), largest = Math.max(...sizes, 0), decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const text = !(step > 0) ? (value) => number(value, 0) : largest >= 1e7 || (largest > step / 2 && largest < 1e-5) ? (value) => value.toExponential(3).replace("e+", "e") : (value) => (Math.round(value * 10 ** decimals) === 0 ? 0 : value).toFixed(Math.min(decimals, 12));
  return values.map((value) => (value === 0 ? "0" : Number.isFinite(value) ? text(value) : "–"));
}

// ---- metrics and verdicts

const VERDICTS = { pass: "pass", fail: "FAIL", none: "none", open: "open", skipped: "skipped", absent: "–", cut: "run too short" }, SIGNS = { pass: "✓", fail: "✗", none: "✗", cut: "run too short" }; // in words, and where several share a line
function badge(verdict, texts = VERDICTS) { return element("b", texts[verdict] ?? "", { className: verdict, title: VERDICTS[verdict] ?? "" }); }

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
  const box = find("expectations"), wasOpen = new Map([...box.querySelectorAll("details")].map((one) => [one.dataset.kind, one.open])), several = about.runs.length > 1;
  const kindOf = (own) => (several && (own.length < about.runs.length || own.some(({ verdict }) => verdict !== own[0].verdict)) ? "differs" : own[0].verdict), groups = byName(about.expectations, ({ name }) => name), problem = about.runs.map((run) => run.problem).filter(Boolean);
  const rowOf = (own) => {
    const [one] = [...own].sort((a, b) => (b.verdict === "fail") - (a.verdict === "fail")), label = element("span", ""), badges = element("div", "");
    const found = button("", () => goTo(one), { className: "outcome", disabled: !one.signal || !nameInPage(one.signal) }), detailsOf = (some) => some.map(({ run, detail }) => `${several ? `${about.runs[run].letter}: ` : ""}${detail}`).join(" ");
    badges.append(...(several ? about.runs.flatMap(({ letter: run }, r) => { const each = element("span", `${run} `); each.append(badge(own.find((other) => other.run === r)?.verdict ?? "absent")); return [each, " "]; }) : [badge(one.verdict)]));
    const small = detailsOf(several ? own.filter(({ verdict }) => verdict === "fail" || (verdict === "skipped" && kindOf(own) === "differs")) : own);
    found.title = detailsOf(own);
    label.append(element("b", one.name), " ", element("small", small === one.name ? "" : small), absent(one));
    found.append(badges, label);
    found.classList.toggle("bad", one.verdict === "fail");
    return found;
  };
  const summary = (r) => {
    const own = about.expectations.filter(({ run }) => run === r), count = (verdict) => own.filter((one) => one.verdict === verdict).length, failed = count("fail"), skipped = count("skipped"), judged = own.length - skipped;
    return own.length && count("open") === own.length ? `${own.length}, judged at the end` : (failed ? `${failed} of ${judged} failed` : `${judged}, none failed`) + (skipped ? `, ${skipped} not judged` : "");
  };
  const folds = Object.entries(KINDS).flatMap(([kind, title]) => { // of one run, failed ones and a few that passed are not folded
    const own = groups.filter((each) => kindOf(each) === kind), isFolded = several || kind === "skipped" || (kind === "pass" && own.length > PASSES);
    if (!own.length || !isFolded) return own.map(rowOf);
    const fold = element("details", "", { open: wasOpen.get(kind) ?? (["differs", "fail"].includes(kind) || own.length <= PASSES * (kind === "pass")) });
    fold.dataset.kind = kind;
    fold.append(element("summary", `${title}${several && kind !== "differs" ? (about.runs.length > 2 ? " in all" : " in both") : ""} (${own.length})`), ...own.map(rowOf));
    return [fold];
  });
  box.classList.toggle("several", several);
  box.hidden = !groups.length && !problem.length;
  box.querySelector("summary").textContent = `Requirements: ${perRun(summary)}`;
  box.querySelector("div").replaceChildren(...problem.map((text) => element("p", text, { className: "twin-soft" })), ...folds);
}

// a page of one file need not have the signal of a requirement
const absent = ({ signal }) => (signal && !nameInPage(signal) ? element("small", " (signal not in this page)") : "");

const referenced = (own) => own.flatMap(({ rows }) => rows).filter((row) => row.reference !== null), compared = (own) => referenced(own).filter(({ verdict }) => verdict === "pass" || verdict === "fail");

// when a run ended [s]
const endOf = (run) => Math.max(...about.cases.filter((one) => one.run === run).map(({ end }) => end));

// metrics of all runs with the paper's values; those of shown variants are marked
function metrics() {
  const box = find("metrics"), shown = new Set(state.cases.map((k) => about.cases[k].variant)), several = about.runs.length > 1, isPair = about.runs.length === 2;
  box.hidden = !about.metrics.length;
  box.querySelector("summary").textContent = `Metrics: ${perRun((r) => {
    const own = about.metrics.filter(({ run }) => run === r), judged = compared(own), all = referenced(own);
    const cut = own.filter(({ rows }) => rows.some(({ verdict }) => verdict === "cut"));
    if (cut.length) return `${several ? "" : "the run "}ends at ${digits(endOf(r))} s, before ${digits(Math.max(...cut.map(({ begin, end }) => end ?? begin)))} s`;
    return judged.length ? `${judged.filter(({ verdict }) => verdict === "pass").length} of ${judged.length} as in the paper` : all.length ? `${all.length} compared, ${all.some(({ verdict }) => verdict === "other") ? "settings differ from the paper's" : "no tolerance given"}` : `${own.length}`;
  })}`;
  box.querySelector("div").replaceChildren(...byName(about.metrics, ({ name, unit }) => `${name} ${unit}`).map((own) => {
    const [one] = own, found = element("div", "", { className: "metric" }), table = element("table", ""), reference = referenced(own).length > 0;
    const name = button(`${one.description || one.name}${one.unit ? ` [${one.unit}]` : ""}`, () => goTo({ ...one, metric: one.name, spans: {} }), { className: "name", title: `${one.name}: ${one.definition}`, disabled: !one.signal || !nameInPage(one.signal) });
    name.append(" ", element("small", one.name)); // as commands and tables call it
    found.append(name, table);
    const head = table.insertRow(), titles = [...(several ? about.runs.map((run) => run.letter) : reference ? ["twin"] : []), ...(isPair ? ["B − A"] : []), ...(reference ? ["paper"] : []), ...(reference && !several ? [compared(own).length ? one.tolerance ?? "" : ""] : [])];
    if (titles.length) ["", ...titles].forEach((text) => head.append(element("th", text)));
    if (several && one.end === null && new Set(own.map(({ run }) => endOf(run))).size > 1) about.runs.forEach((_, r) => head.cells[r + 1].append(element("small", `to ${digits(endOf(r))} s`)));
    const seeds = [...new Set(own.flatMap(({ rows }) => rows.map((row) => row.seeds)))].filter(Boolean);
    if (isPair && seeds.length) head.cells[3].append(element("small", `in ${seeds.length > 1 ? "common seeds" : `${seeds[0]} seed${seeds[0] > 1 ? "s" : ""}`}`));
    for (const variant of new Set(own.flatMap(({ rows }) => rows.map((row) => row.variant)))) {
      const made = table.insertRow(), rows = about.runs.map((_, r) => own.find(({ run }) => run === r)?.rows.find((row) => row.variant === variant));
      made.classList.toggle("twin-soft", !shown.has(variant));
      made.insertCell().textContent = variant;
      rows.forEach((row, r) => {
        const cell = made.insertCell(), isRecorded = about.cases.some((each, k) => each.run === r && recorded(one.signal, k));
        cell.append(row?.value ?? "–", " ");
        if (!row && about.cases.some((each) => each.run === r && each.variant === variant)) cell.append(element("small", isRecorded ? "no value" : "not recorded"));
        if (row?.range) Object.assign(cell, { title: `seeds: ${row.range}` });
        if (several && row) cell.append(badge(row.verdict, SIGNS)); else if (row?.range) cell.append(element("small", row.range));
      });
      if (isPair) made.insertCell().textContent = rows[1]?.change || "–";
      if (reference) made.insertCell().textContent = rows.find((row) => row?.reference)?.reference ?? "";
      if (!several) made.insertCell().append(rows[0].reference !== null && !VERDICTS[rows[0].verdict] ? element("small", "not judged") : badge(rows[0].verdict));
    }
    return found;
  }));
}

// show the signal of an expectation or a metric, in its window; of a failed expectation, its first failed span
function goTo(one) {
  const variants = one.variants?.length ? one.variants : undefined; // those that are judged
  const paneOf = (name) => state.panes.find((each) => each.kind === "time" && (!variants || String(each.variants) === String(variants)) && each.items.some((item) => item.minus === null && [item.signal, heads.get(item.signal)?.key].includes(name)));
  const panes = judgedSignals(one).map((name) => paneOf(name) ?? pane([name], { variants }));
  state.panes.splice(state.panes.indexOf(panes[0]) + 1, 0, ...panes.filter((own) => !state.panes.includes(own)));
  for (const own of state.panes) Object.assign(own, { metric: own === panes.at(-1) ? one.metric : undefined, requirement: !one.metric && panes.includes(own) ? one.name : undefined });
  if (variants && !state.cases.some((k) => about.cases[k].run === one.run && variants.includes(about.cases[k].variant)))
    state.cases = [...state.cases, ...about.cases.flatMap((each, k) => (each.run === one.run && variants.includes(each.variant) ? [k] : []))];
  const bad = Object.keys(one.spans).map(Number), [low, high] = extentOf(), move = state.offsets[one.run];
  if (bad.length) {
    if (!bad.some((k) => state.cases.includes(k))) state.cases = [...state.cases, bad[0]];
    state.window = windowOfFailure(one, state);
  } else state.window = one.begin === null && one.end === null ? null : [(one.begin ?? low - move) + move, (one.end ?? high - move) + move];
  show();
  reveal(state.panes.indexOf(panes[0]));
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
