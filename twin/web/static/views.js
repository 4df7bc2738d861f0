// Pictures of the machine: SVG views of its components and scenes, moved by values of signals.

import { bench } from "./view_bench.js";
import { rig } from "./view_rig.js";
import { scene } from "./view_scene.js";
import { vessel } from "./view_vessel.js";

const VIEWS = { rig, bench, vessel, scene };

// draw views into an element; returns (values, reached, time) => void: values by name of signal, names of reached targets, time of a replay [s]
export function drawViews(element, views) {
  const moved = views.map((view) => {
    const place = element.appendChild(document.createElement("div"));
    place.className = `twin-view twin-view-${view.view}`;
    return VIEWS[view.view](place, view);
  });
  const targets = views.flatMap((view) => view.targets || []);
  return (values, reached = [], time = -Infinity) => {
    const names = [...reached, ...targets.filter((target) => target.time <= time).map((target) => target.name)];
    const of = (part, name) => (part && part.signals[name] in values ? values[part.signals[name]] : undefined);
    for (const move of moved) move(of, names);
  };
}

// names of the signals that move views
export function movingSignals(views) { return [...new Set(views.flatMap((view) => view.parts.flatMap((part) => Object.values(part.signals))))]; }

// the value of an instant: a number, or nested arrays with null for what is missing
export function elementOf(values, k, shape) {
  const size = shape.reduce((a, b) => a * b, 1), of = (index) => (Number.isFinite(values[index]) ? values[index] : null);
  if (!shape.length) return of(k) ?? undefined;
  const nest = (begin, [count, ...inner]) => {
    const step = inner.reduce((a, b) => a * b, 1);
    return Array.from({ length: count }, (_, i) => (inner.length ? nest(begin + i * step, inner) : of(begin + i)));
  };
  return nest(k * size, shape);
}
