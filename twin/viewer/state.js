// What is shown: `state` is stored in the URL; everything else follows from it.
//
//   panes:   [{kind: "time" | "xy" | "spectrum", items: [{signal, minus}], x, plot, range, domain, facet, weights, variants, metric, requirement}]
//            minus: a case's number, a run's as "A", or a variant's as "=PI"; variants: if set, the only ones of the pane; metric: whose values are drawn; requirement: the only one whose limits are drawn; facet: "" | "variant" | "run", a pane for each; weights: heights of these
//   cases:   numbers of the shown cases       window: [from, to] or null       cursors: [a, b]
//   offsets: shift of each run in time [s]    band: seeds as mean and range    time: of the time cursor, or null
//   scene:   case of the picture, or null     span: of a run in progress, the time that is shown up to now [s], or null

const about = JSON.parse(document.getElementById("about").textContent);
const source = about.embedded ? new EmbeddedSource(about) : new ServerSource();
const signals = new Map(about.signals.map((one) => [one.name, one]));
const heads = new Map(); // of a signal: its units and how it is drawn, once it was read
const DASHES = [[], [7, 3], [2, 2], [9, 3, 2, 3], [14, 4], [1, 4]];
const OPACITIES = [1, 0.7, 0.5]; // of seeds
const SEEDS = /, \d+ seeds/;
const GROUPS = 6, FIRST_PLOTS = 2, FIRST_PANES = 4, CURVES = 6; // shown at first: variants, plots, panes, curves of several signals in a pane
const PANES = 24, SAMPLES = 20e6; // at most: panes of an address; samples of seeds that are shown together
const LATEST = 60; // shown at first of a rig that is followed [s]
const find = (id) => document.getElementById(id);
let state;

function first() {
  const firsts = firstGroups(), samples = firsts.flatMap(({ cases }) => cases).reduce((sum, k) => sum + about.cases[k].samples, 0);
  const isCommon = (k) => { const { variant, seed } = about.cases[k]; return firsts.every((group) => group.variant !== variant || group.cases.some((other) => about.cases[other].seed === seed)); };
  const seeds = samples <= SAMPLES ? firsts.flatMap(({ cases }) => (cases.some(isCommon) ? cases.filter(isCommon) : cases)) : firsts.map(({ cases }) => cases[0]); // runs are compared over their common seeds
  const found = { panes: [], cases: about.shown.length ? about.shown : seeds, window: null, cursors: [], offsets: about.runs.map(() => 0), band: true, time: null, scene: null, span: about.following && about.growing ? LATEST : null };
  const own = about.shown_signals, failed = about.expectations.find((one) => one.verdict === "fail" && Object.keys(one.spans).length && (own.length || judgedSignals(one).length));
  if (own.length) found.panes = together(own, groupsOf(found.cases, true).length);
  if (failed) {
    const isWindow = failed.failed_at === null && !failed.sources.length, isShown = found.cases.some((k) => failed.spans[k]); // of a metric: its signal may be one number
    if (!own.length) {
      found.panes = judgedSignals(failed).map((name) => pane([name], { variants: failed.variants.length ? failed.variants : undefined, requirement: failed.name }));
      if (isWindow) found.panes.push(...firstPlots(1).slice(0, 1));
      if (!isShown) found.cases = [+Object.keys(failed.spans)[0], ...found.cases];
    }
    if (!isWindow && (isShown || !own.length)) found.window = windowOfFailure(failed, found);
    found.scene = found.cases.find((k) => failed.spans[k]) ?? null;
  } else if (!own.length) {
    found.panes = firstPlots(new Set(found.cases.map((k) => about.cases[k].variant)).size);
    for (const one of found.panes) found.cases = withVariants(found.cases, one.variants);
    found.window = windowOfPlots(found.panes.map(plotOf), found.cases);
  }
  return found;
}

// the signals that show what an expectation or a metric judges: those from which an analysis computes it come first
const judgedSignals = ({ sources, signal }) => [...sources.slice(0, FIRST_PLOTS), signal].filter(Boolean).map(nameInPage).filter(Boolean);

// the first failed span in shown cases, with a margin
function windowOfFailure({ spans, run }, { cases, offsets }) {
  const shown = cases.filter((k) => spans[k]), [from, to] = shown.map((k) => spans[k][0]).sort((a, b) => a[0] - b[0])[0], own = about.cases[shown[0]];
  const margin = Math.max((to - from) / 2, (own.end - own.begin) / 20);
  return [Math.max(from - margin, own.begin), Math.min(to + margin, own.end)].map((time) => time + offsets[run]);
}

// these cases, and those of some variants if none of them is of these
function withVariants(cases, variants) {
  const isOf = (k) => variants.includes(about.cases[k].variant);
  return !variants || cases.some(isOf) ? cases : [...cases, ...[...about.cases.keys()].filter(isOf)];
}

// the time that all windows of some plots cover, as far as it was recorded; null: all
function windowOfPlots(plots, cases) {
  const recorded = cases.map((k) => about.cases[k]).filter((one) => one.samples), windows = plots.map((plot) => plot?.window ?? [null, null]);
  if (about.growing || !recorded.length || !windows.length || windows.some(([from, to]) => from === null && to === null)) return null;
  const low = Math.min(...recorded.map((one) => one.begin)), high = Math.max(...recorded.map((one) => one.end));
  const from = Math.max(low, Math.min(...windows.map((one) => one[0] ?? low))), to = Math.min(high, Math.max(...windows.map((one) => one[1] ?? high)));
  return to > from ? [from, to] : null;
}

// of each run as many variants, the same ones if the runs have some in common
function firstGroups() {
  const groups = groupsOf(about.cases.map((_, k) => k), true), runs = [...about.runs.keys()].map((run) => groups.filter((group) => group.run === run));
  const has = (own, variant) => own.some((group) => group.variant === variant), common = runs[0].filter(({ variant }) => runs.every((own) => has(own, variant)));
  return runs.flatMap((own) => (common.length ? common.map(({ variant }) => own.find((group) => group.variant === variant)) : own).slice(0, Math.max(Math.floor(GROUPS / runs.length), 1)));
}

// the first plots that fit: one that is split into a pane for each variant counts as many
function firstPlots(variants) {
  const drawable = about.plots.filter(isDrawable);
  if (about.following) return drawable.filter((plot) => plot.first).map(ofPlot);
  const panes = [];
  let count = 0;
  for (const plot of drawable.map(ofPlot)) {
    const own = plot.facet ? variants : 1;
    if (panes.length && (panes.length === FIRST_PLOTS || count + own > FIRST_PANES)) continue;
    panes.push(plot);
    count += own;
  }
  return panes;
}

// the name of a signal in this page, whose expressions may be written otherwise; undefined if a page of one file does not have it
const nameInPage = (signal) => (about.embedded ? about.embedded.find((one) => one.signal === signal || one.head.key === signal)?.signal : signal);
const isDrawable = (plot) => [...plot.signals, plot.x].filter(Boolean).every(nameInPage);

const pane = (names, more = {}) => ({ kind: "time", items: names.map((signal) => ({ signal, minus: null })), facet: "", weights: [], ...more });
const ofPlot = (plot) => pane(plot.signals, { variants: plot.variants?.length ? plot.variants : undefined, ...(plot.x ? { kind: "xy", x: plot.x, plot: plot.title } : { plot: plot.title, range: plot.range || undefined, facet: plot.per_variant && plot.signals.length > 1 ? "variant" : "" }) });

// signals of one unit in one pane, unless it had too many curves
function together(names, groups) {
  const panes = new Map(), count = (unit) => groups * names.filter((name) => unitOf(name) === unit).length;
  for (const name of names) {
    const own = unitOf(name), unit = own === undefined || (names.length <= PANES && count(own) > CURVES) ? name : own;
    if (!panes.has(unit)) panes.set(unit, pane([]));
    panes.get(unit).items.push({ signal: name, minus: null });
  }
  return [...panes.values()];
}

// ---- the state in the URL, whose text is not trusted

function remembered() {
  try {
    const saved = JSON.parse(decodeURIComponent(location.hash.slice(1)));
    const whole = (value) => Number.isInteger(value) && value >= 0 && value < about.cases.length;
    const pair = (value) => Array.isArray(value) && value.every(Number.isFinite);
    const range = (ends) => (pair(ends) && ends.length === 2 && ends[1] > ends[0] ? ends : undefined);
    const items = (one) => one.items.filter((item) => typeof item.signal === "string").map(({ signal, minus }) => ({ signal, minus: minus ?? null }));
    const weights = (one) => (pair(one.weights ?? []) ? (one.weights ?? []).filter((weight) => weight > 0) : []);
    return {
      panes: saved.panes.filter((one) => ["time", "xy", "spectrum"].includes(one.kind)).slice(0, PANES).map((one) => ({
        ...one, items: items(one), range: range(one.range), domain: range(one.domain), facet: ["variant", "run"].includes(one.facet) ? one.facet : "", weights: weights(one), variants: Array.isArray(one.variants) ? one.variants : undefined })),
      cases: saved.cases.filter(whole),
      window: range(saved.window) ?? null,
      cursors: pair(saved.cursors) ? saved.cursors.slice(0, 2) : [],
      offsets: about.runs.map((_, k) => (Number.isFinite(saved.offsets?.[k]) ? saved.offsets[k] : 0)),
      band: saved.band !== false,
      time: Number.isFinite(saved.time) ? saved.time : null,
      scene: whole(saved.scene) ? saved.scene : null,
      span: saved.span > 0 && Number.isFinite(saved.span) ? saved.span : null,
    };
  } catch { return null; }
}

const address = () => `#${encodeURIComponent(JSON.stringify(state))}`;

const steady = () => JSON.stringify({ ...state, cursors: [], time: null });

// Each change is a step in the history of the browser, which undoes it, but for those of cursors. `history.state`: number of steps.
function keep() {
  clearTimeout(keep.due);
  keep.due = setTimeout(() => {
    const now = steady(), isStep = keep.last !== undefined && keep.last !== now;
    history[isStep ? "pushState" : "replaceState"]((history.state ?? 0) + isStep, "", address());
    keep.last = now;
    find("undo").disabled = !history.state;
  }, 200);
}

// ---- cases, and groups of them that are one curve

const letter = (minus) => typeof minus === "string";
const offset = (number) => state.offsets[about.cases[number].run];
const unitOf = (signal) => heads.get(signal)?.unit ?? signals.get(signal)?.unit;
const recorded = (signal, number) => { const one = signals.get(signal); return !one || one.cases === "all" || one.cases.includes(number); };

// the subtracted case: itself, the same variant and seed of a run, or the same run and seed of a variant
function other(minus, number) {
  if (!letter(minus)) return minus;
  const own = about.cases[number], { run, variant } = minus.startsWith("=") ? { run: own.run, variant: minus.slice(1) } : { run: about.runs.findIndex((one) => one.letter === minus), variant: own.variant };
  return about.cases.findIndex((one) => one.run === run && one.variant === variant && one.seed === own.seed);
}

// the seeds of shown variants that a page of one file does not have, in words
function seedsNotHere() {
  const own = about.embedded ? about.cases.filter((one, k) => !about.shown.includes(k) && about.shown.some((other) => about.cases[other].run === one.run && about.cases[other].variant === one.variant)) : [];
  const seeds = [...new Set(own.map(({ seed }) => seed))];
  return seeds.length ? `; seed${seeds.length > 1 ? "s" : ""} ${seeds.join(", ")} not in this page` : "";
}

// cases by run and variant, or each alone
function groupsOf(numbers, band) {
  const groups = new Map();
  for (const number of numbers) {
    const { run, variant, seed } = about.cases[number], name = JSON.stringify(band ? [run, variant] : [run, variant, seed]);
    if (!groups.has(name)) groups.set(name, { run, variant, seed: band ? null : seed, cases: [] });
    groups.get(name).cases.push(number);
  }
  return [...groups.values()];
}

function groupLabel({ run, variant, cases }) {
  const parts = [`${about.runs.length > 1 ? `${about.runs[run].letter}: ` : ""}${variant}`];
  if (cases.length > 1) parts.push(`${cases.length} seeds`);
  else if (about.cases.some((one) => one.run === run && one.variant === variant && one.seed !== about.cases[cases[0]].seed)) parts.push(`seed ${about.cases[cases[0]].seed}`);
  return parts.join(", ");
}

// ---- from state to panes of the chart

const lessOf = (minus) => (minus === null ? "" : ` − ${letter(minus) ? minus.replace(/^=/, "") : about.cases[minus].label}`);
const plotOf = (one) => about.plots.find((each) => each.title === one.plot);

// the plot of a pane, else one that has its signals with a band or lines, or is of its only signal
const referenceOf = (one) => plotOf(one) ?? about.plots.find(({ signals: names, band, lines, x, first: isTitled }) => one.kind === "time" && !x
  && (band.length + lines.length > 0 || (isTitled && names.length === 1)) && one.items.every(({ signal, minus }) => minus === null && names.includes(signal)));

// panes of the chart: those of the state, one for each variant or run where they are split; `place`: index in the state
function shownPanes() {
  return state.panes.flatMap((one, place) => {
    const own = state.cases.filter((k) => !one.variants || one.variants.includes(about.cases[k].variant)), parts = one.facet ? [...new Set(own.map((k) => about.cases[k][one.facet]))] : [null];
    return parts.map((part, k) => {
      const cases = part === null ? own : own.filter((number) => about.cases[number][one.facet] === part);
      return { ...shownPane(one, cases, part === null ? "" : one.facet === "run" ? about.runs[part].letter : part), weight: one.weights[k] || 1, place, part: k };
    });
  });
}

function shownPane(one, cases, part) {
  const lines = drawnBy(one, cases), head = lines.map((line) => heads.get(line.name)).find(Boolean);
  const own = unitOf(one.items[0]?.signal) ?? "", unit = head?.unit ?? (one.kind === "spectrum" ? squared(own) : own), title = [titled(one), part].filter(Boolean).join(": ");
  const found = { title, unit, range: one.range, domain: one.domain, home: plotOf(one)?.range || undefined, curves: lines, own: one.kind !== "time", log: one.kind === "spectrum" ? "xy" : "" };
  if (found.own) found.x = { label: one.kind === "spectrum" ? "frequency" : one.x, unit: `[${head?.x_unit || (one.kind === "xy" ? signals.get(one.x)?.unit : "Hz") || ""}]` };
  const plot = referenceOf(one);
  if (plot && one.items.every((item) => item.minus === null)) Object.assign(found, { band: plot.band.length ? plot.band : null, lines: plot.lines });
  found.hidden = [...new Set(state.cases.map((k) => about.cases[k].variant))].filter((variant) => one.variants && !one.variants.includes(variant));
  if (one.kind === "time") Object.assign(found, judged(lines, one.requirement));
  if (one.metric && one.kind === "time") found.limits.push(...levels(one.metric, lines));
  if (one.kind === "time" && !one.items.some(({ minus }) => minus !== null)) found.axis = `${titled(one)} ${unit}`;
  found.ending = (one.kind === "spectrum" ? `, ${summarized().map((time) => +readableTime(time, ...summarized())).join(" to ")} s` : "") + shorten(lines);
  if (one.kind === "time" && plotOf(one)?.fan) found.curves = [...lines, ...fan(plotOf(one).fan, lines.length)];
  return found;
}

// what all labels of a pane end with, such as `3 seeds`: its title has it instead
function shorten(lines) {
  const [end, ...others] = new Set(lines.map(({ label }) => /, [^,]+$/.exec(label)?.[0] ?? ""));
  if (lines.length > 1) for (const line of lines) line.short = line.label.replace(SEEDS, "");
  if (!end || others.length || lines.length < 2) return "";
  for (const line of lines) line.short = line.label.slice(0, -end.length);
  return end.replace(/ \u2212 .*/, ""); // what is subtracted is in the title
}

// the last forecast of a followed rig: median and 90 % band of a signal, from now on
function fan(path, color) {
  const known = about.following?.forecast, own = Object.values(known?.signals || {}).find((one) => one.path === path);
  if (!own || !state.cases.some((k) => about.cases[k].run === about.following.run)) return [];
  const named = (part) => JSON.stringify([{ kind: "fan", path, part }, 0]);
  const label = `forecast${own.chance === null || !own.limits.length ? "" : `, ${Math.round(100 * own.chance)} % leave ${own.limits.map(digits).join(" to ")} ${own.unit}`}`;
  return [{ name: named("median"), low: named("low"), high: named("high"), label, color, dash: DASHES[2], about: `${path}: 90 % band of the forecast made at ${digits(known.start)} s`,
            spec: { kind: "fan", case: 0 }, item: { signal: path, minus: null } }];
}

function titled(one) {
  const names = one.items.map((item) => item.signal + lessOf(item.minus)).join(", ");
  const what = one.kind === "xy" ? `${names} over ${one.x}` : one.kind === "spectrum" ? `Spectrum of ${names}` : names;
  const plot = referenceOf(one);
  return plot && (plot.first ? one.plot || plot.signals.length === 1 : one.plot && one.items.length > 1) ? plot.title : what;
}

// Appearance of a case, whichever cases are shown: its color is of its variant (of its run, if all are of one variant), its dash of its run
// (of its seed, if there is one run), its opacity of its seed.
const numberIn = (key) => { const values = [...new Set(about.cases.map((one) => one[key]))]; return { count: values.length, of: new Map(values.map((value, k) => [value, k])) }; };
const variantNumbers = numberIn("variant"), seedNumbers = numberIn("seed");

function appearance({ run, variant, cases, seed }) {
  const place = variantNumbers.of.get(variant), number = seed === null || cases.length > 1 ? 0 : seedNumbers.of.get(seed);
  return { color: variantNumbers.count > 1 ? place : run, ...lineOf(run, OPACITIES[number % OPACITIES.length]), dash: (about.runs.length > 1 ? Math.max(run - 1, 0) : number) + Math.floor(place / 8) };
}

// how the curves of a run are drawn: of several, those of the first are wide and pale, so that equal ones are seen on them, those of the second solid, as limits are dashed
const lineOf = (run, opacity = 1) => (about.runs.length > 1 && !run ? { width: 5, opacity: 0.45 * opacity, dash: [] } : { opacity, dash: about.runs.length > 1 ? DASHES[(run - 1) % DASHES.length] : [] });

// The curves of a pane. A single signal has the colors and dashes of its cases; of several signals, each has a color, and each run and variant a dash.
// A color means one thing in all panes: those of signals follow those of the cases.
function drawnBy(one, cases) {
  const several = one.items.length > 1, labels = plotOf(one)?.labels || [], found = [];
  const groups = (minus) => {
    const all = groupsOf(cases, state.band && (minus === null || letter(minus)));
    all.sort((a, b) => variantNumbers.of.get(a.variant) - variantNumbers.of.get(b.variant)); // the same variant of several runs in turn
    return one.kind === "time" ? all : all.map((group) => ({ ...group, cases: group.cases.slice(0, 1) })); // loops and spectra have no mean over seeds
  };
  const parts = [...new Set(cases.map((k) => JSON.stringify([about.cases[k].run, about.cases[k].variant])))];
  const colored = [...new Set(state.panes.filter((each) => each.items.length > 1).flatMap((each) => each.items.map(({ signal }) => signal)))];
  const first = Math.max(variantNumbers.count, about.runs.length), taken = first > 1 ? first : 0;
  one.items.forEach((item, i) => {
    const all = groups(item.minus);
    for (const group of all) {
      const line = curveOf(one, item, group);
      if (!line) continue;
      const own = appearance(group), name = labels[i] && item.minus === null ? labels[i] : item.signal + lessOf(item.minus);
      if (several) Object.assign(own, { color: taken + colored.indexOf(item.signal), dash: parts.indexOf(JSON.stringify([group.run, group.variant])) });
      const label = !several && !(labels[i] && all.length === 1 && plotOf(one).first) ? groupLabel(group) + lessOf(item.minus) : all.length === 1 ? name : `${name}, ${groupLabel(group)}`;
      found.push({ ...line, ...own, color: own.color % 8, dash: DASHES[own.dash % DASHES.length], label, about: `${item.signal}: ${signals.get(item.signal)?.about || groupLabel(group)}` });
    }
  });
  return found;
}

function curveOf(one, item, { cases }) {
  const less = (number) => (item.minus === null ? null : other(item.minus, number)), there = cases.filter((number) => recorded(item.signal, number) && ![number, -1].includes(less(number))), [number] = there;
  if (number === undefined) return null;
  const minus = less(number), isMany = there.length > 1, spec = { kind: one.kind, signal: item.signal, case: number, minus, x: one.kind === "xy" ? one.x : "",
                 shift: minus === null ? 0 : offset(minus) - offset(number), seeds: isMany ? there : [], partners: isMany && minus !== null ? there.map(less) : [] };
  const named = (part) => JSON.stringify([{ ...spec, part }, offset(number)]);
  const edges = minus === null && one.kind === "time" && !isMany ? bandOf(item.signal) : null;
  const edge = (signal) => JSON.stringify([{ ...spec, signal, part: "mean" }, offset(number)]);
  const range = isMany ? { low: named("low"), high: named("high") } : edges ? { low: edge(edges[0]), high: edge(edges[1]) } : {};
  return { spec: { ...spec, part: "mean" }, item, cases: there, name: named("mean"), ...range, step: heads.get(item.signal)?.real === false && one.kind === "time" };
}

// signals of the edges of the band around a signal of a followed rig; a page of one file need not have them
function bandOf(signal) {
  const edges = about.plots.map((plot) => plot.bands[signal]).find(Boolean);
  return edges?.every((edge) => !about.embedded || about.embedded.some((one) => one.signal === edge)) ? edges : null;
}

// the worst window of an analysis, of several seeds the time that theirs cover
function windowText(spans) {
  const from = Math.min(...spans.map((one) => one.from)), to = Math.max(...spans.map((one) => one.to)), isOne = spans.every((one) => one.from === from && one.to === to);
  return `, worst window${isOne ? "" : "s"} ${digits(from)} s to ${digits(to)} s`;
}

// Limits and failed spans of the signals of a pane. `only`: of this requirement, so that no curve is judged by the limits of others;
// `violations`: the names of the failed expectations with their variants.
function judged(lines, only) {
  const limits = [], spans = [], traced = [], violations = new Map();
  for (const each of about.expectations) {
    if (only !== undefined && each.name !== only) continue;
    const isOf = ({ spec }, name) => [spec.signal, heads.get(spec.signal)?.key].includes(name);
    const own = lines.filter((line) => line.item.minus === null && [each.signal, ...each.sources].some((name) => isOf(line, name)) && about.cases[line.spec.case].run === each.run
      && (!each.variants.length || each.variants.includes(about.cases[line.spec.case].variant)));
    if (!each.signal || !own.length) continue;
    const move = state.offsets[each.run];
    for (const y of own.some((line) => isOf(line, each.signal)) ? [each.low, each.high] : []) if (y !== null) limits.push({ y, from: each.begin === null ? -Infinity : each.begin + move, to: each.end === null ? Infinity : each.end + move, failed: each.verdict === "fail" });
    for (const number of own.flatMap(({ cases }) => cases)) {
      const { variant } = about.cases[number], name = `${about.runs.length > 1 ? `${about.runs[each.run].letter}: ` : ""}${/[ ,]/.test(variant) ? `"${variant}"` : variant}`;
      for (const [from, to] of each.spans[number] || []) {
        const isTraced = each.sources.length > 0, own = { from: from + move, to: to + move };
        (isTraced ? traced : spans).push({ ...own, text: `fails: ${each.name}, in ${name}${isTraced ? windowText([own]) : ""}`, what: each.name, name });
      }
    }
  }
  const marked = spans.length ? spans : traced; // a window of many seconds would hide failed samples
  for (const span of marked) violations.set(span.what, [...(violations.get(span.what) ?? []), span]);
  return { limits, spans: marked, violations: [...violations].map(([what, own]) => `${what}, in ${[...new Set(own.map(({ name }) => name))].join(", ")}${marked === traced ? windowText(own) : ""}`) };
}

// lines at the values of a metric over its window, in the colors of its curves
function levels(name, lines) {
  return about.metrics.filter((own) => own.name === name).flatMap(({ run, rows, begin, end, reduce }) => lines.flatMap(({ spec, item, color }) => {
    const own = about.cases[spec.case], level = own.run === run && item.minus === null ? rows.find(({ variant }) => variant === own.variant)?.level : null, move = state.offsets[run];
    return Number.isFinite(level) ? [{ y: level, from: (begin ?? -Infinity) + move, to: (end ?? Infinity) + move, color, name: reduce }] : [];
  }));
}

// the time of the shown cases; `span`: of a run in progress, its last seconds
const extentOf = (span = state.span) => {
  const chosen = state.cases.length ? state.cases : about.cases.map((_, k) => k), shown = chosen.filter((k) => about.cases[k].samples);
  const ahead = about.following?.forecast ? [about.following.forecast.time.at(-1) + state.offsets[about.following.run]] : [];
  const from = Math.min(...shown.map((k) => about.cases[k].begin + offset(k))), to = Math.max(...shown.map((k) => about.cases[k].end + offset(k)), ...ahead);
  if (about.growing && span && to - span > from) return [to - span, to];
  return to > from ? [from, to] : Number.isFinite(from) ? [from, from + 1] : [0, 1];
};
