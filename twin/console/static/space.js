// A scene in three dimensions, drawn by three.js: tube, lines, points, targets, surfaces and forces. Millimeters; colors of the
// theme. Only what changes is drawn: there is no loop that runs on.

import { channel } from "/console/channel.js";
import { CSS2DObject, CSS2DRenderer, OrbitControls, THREE } from "nicegui-scene";

const AXES = { x: new THREE.Vector3(1, 0, 0), y: new THREE.Vector3(0, 1, 0), z: new THREE.Vector3(0, 0, 1) };
const TURNED = [0.45, 0.35];      // of the first view about the axes up and to the right [rad]: from straight ahead a plane looks flat
const ROOM = 0.84;                // part of the picture that the scene fills
const NARROW = 520, PART = 0.46;  // width of a picture [px] below which it shows a part around the foremost tip, as in two dimensions
const THIN = 1.3, WIDER = 0.3;    // smallest radius of a line [px], and what its width adds [px/mm]: one in another is seen
const DOT = 5;                    // smallest radius of a point [px]
const SHAFT = 2, HEAD = [16, 6];  // arrow: radius of its shaft, length and radius of its head [px]
const ABOVE = [0.5, 1.6], BELOW = [0.5, -0.6], SIDES = [ABOVE, BELOW, [-0.15, 0.5], [1.15, 0.5], [0.5, 2.9], [0.5, -1.9]];  // of labels, as parts of their size
const LINES = ["--line-0", "--line-1", "--ink", "--line-3"];  // the first curves of charts: catheter, then guidewire
const ROUND = 2;                  // pieces of a tube from point to point
const STEPS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];  // of the scale bar [mm]

class Picture {
  constructor(canvas, labels, fixed, onDraw) {
    Object.assign(this, { fixed, canvas, onDraw, colored: [], frame: null, due: 0 });
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.names = new CSS2DRenderer({ element: labels });
    this.world = new THREE.Scene();
    this.camera = new THREE.OrthographicCamera(-1, 1, 1, -1, -1e5, 1e5);  // its zoom is px per mm, everywhere
    this.right = AXES["xyz"[fixed.axes[0]]];
    this.camera.up.copy(AXES["xyz"[fixed.axes[1]]]);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => { this.isTurned = true; });  // or moved: a new width keeps it
    const light = new THREE.DirectionalLight(0xffffff, 2.2);
    light.position.set(-1, 2, 3);
    this.camera.add(light);
    this.world.add(this.camera, new THREE.AmbientLight(0xffffff, 1.6));
    this.build();
    this.recolor();
  }

  // ---- objects

  material(color, options = {}) {
    const one = new THREE.MeshPhongMaterial({ shininess: 25, ...options });
    this.colored.push([one, color]);
    return one;
  }
  add(geometry, material) {
    const mesh = new THREE.Mesh(geometry, material);
    this.world.add(mesh);
    return mesh;
  }
  name(text, parent = this.world, center = ABOVE, kind = "") {
    const element = document.createElement("div");
    element.className = `twin-space-name ${kind}`;
    element.textContent = text;
    const label = new CSS2DObject(element);
    label.center.set(...center);
    parent.add(label);
    return label;
  }

  build() {
    const { tube, targets, lines, points, surfaces, forces } = this.fixed;
    const clear = { transparent: true, side: THREE.DoubleSide, depthWrite: false };
    if (tube) this.add(tubeOf(tube.points, tube.radii, 28), this.material("--tissue-2", { ...clear, opacity: 0.28 }));
    this.lines = lines.map((_, k) => this.add(new THREE.BufferGeometry(), this.material(LINES[k % LINES.length])));
    const ball = new THREE.SphereGeometry(1, 24, 16);
    this.points = points.map((point, k) => {
      const mesh = this.add(ball, this.material(LINES[k % LINES.length]));
      mesh.label = this.name(point.label, this.world, BELOW, "twin-space-point");
      return mesh;
    });
    this.targets = targets.map((target) => {
      const mesh = this.add(ball, this.material("--warn", { ...clear, opacity: 0.5 }));
      mesh.position.set(...target.at);
      mesh.label = this.name(target.name);
      mesh.label.position.set(...target.at);
      return mesh;
    });
    this.surfaces = surfaces.map(({ diameter, normal, label }) => {
      const mesh = this.add(capOf(diameter), this.material("--tissue", { side: THREE.DoubleSide, transparent: true, opacity: 0.8 }));
      mesh.quaternion.setFromUnitVectors(AXES.y, new THREE.Vector3(...normal));
      mesh.label = this.name(label);
      mesh.rim = Math.abs(normal[1]) > 0.5 ? AXES.x : AXES.y;
      return mesh;
    });
    this.forces = forces.map(() => {
      const group = new THREE.Group(), paint = this.material("--fail", { depthTest: false });
      group.shaft = new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 1, 12).translate(0, 0.5, 0), paint);
      group.head = new THREE.Mesh(new THREE.ConeGeometry(1, 1, 20).translate(0, -0.5, 0), paint);
      group.add(group.shaft, group.head);
      group.shaft.renderOrder = group.head.renderOrder = 8;  // over what it acts on
      group.label = this.name("");
      this.world.add(group);
      return group;
    });
    this.axes = new THREE.AxesHelper(1);
    this.axes.material.depthTest = false;
    this.axes.renderOrder = 9;
    for (const [name, at] of Object.entries(AXES)) {
      this.name(name, this.axes, [0.5, 0.5]).position.copy(at).multiplyScalar(1.25);
    }
    this.world.add(this.axes);
  }

  recolor() {
    const style = getComputedStyle(document.body), of = (name) => style.getPropertyValue(name).trim();
    for (const [material, name] of this.colored) material.color.set(of(name));
    const ink = new THREE.Color(of("--ink"));
    this.axes.setColors(ink, ink, ink);
    this.draw();
  }

  // ---- an instant

  move(frame, reached) {
    Object.assign(this, { frame, reached, isStale: true });
    this.draw();
  }

  // done once a drawn frame, however many ticks come before it
  apply() {
    const { frame } = this;
    this.targets.forEach((mesh, k) => {
      const color = this.reached.includes(this.fixed.targets[k].name) ? "--good" : "--warn", paint = this.colored.find(([one]) => one === mesh.material);
      if (paint[1] !== color) { paint[1] = color; this.recolor(); }
    });
    this.points.forEach((mesh, k) => this.place(mesh, frame.points[k]));
    this.surfaces.forEach((mesh, k) => {
      if (this.place(mesh, frame.surfaces[k])) mesh.label.position.addScaledVector(mesh.rim, 0.5 * this.fixed.surfaces[k].diameter);
    });
    if (!this.quarter && this.canvas.clientWidth) this.reset();
    this.shapes();
    this.follow();
  }
  // on a telephone, until a person turns the picture
  follow() {
    const tip = this.frame.points.filter(Boolean).map((at) => new THREE.Vector3(...at)).sort((a, b) => b.dot(this.right) - a.dot(this.right))[0], seen = tip?.clone().project(this.camera);
    if (this.isTurned || !this.isNarrow() || !seen || Math.max(Math.abs(seen.x), Math.abs(seen.y)) < 0.5) return;
    const move = tip.sub(this.controls.target);
    for (const moved of [this.controls.target, this.camera.position]) moved.add(move);
    this.controls.update();
  }
  isNarrow() { return this.fixed.tube && this.canvas.clientWidth < NARROW; }

  place(object, at) {
    object.visible = object.label.visible = Boolean(at);
    if (at) { object.position.set(...at); object.label.position.set(...at); }
    return at;
  }

  // lines and arrows, whose thickness depends on the zoom
  shapes() {
    const px = 1 / this.camera.zoom;
    this.lines.forEach((mesh, k) => {
      mesh.geometry.dispose();
      const points = (this.frame.lines[k] || []).filter(Boolean), { width } = this.fixed.lines[k], radius = Math.max(width / 2, (THIN + WIDER * width) * px);
      mesh.geometry = tubeOf(points, points.map(() => radius), 10);
    });
    const thick = Math.max(0, ...this.fixed.lines.map((line) => line.width)) / 2;
    for (const mesh of this.points) mesh.scale.setScalar(Math.max(DOT * px, 1.25 * thick));
    for (const mesh of this.targets) mesh.scale.setScalar(Math.max(this.fixed.tolerance, 1.4 * DOT * px));
    this.forces.forEach((group, k) => {
      const { at, vector } = this.frame.forces[k], { label, largest } = this.fixed.forces[k];
      const size = vector ? Math.hypot(...vector) : 0, length = (size / largest) * this.quarter;
      if (!this.place(group, size > 0.005 * largest ? at : null)) return;
      const along = new THREE.Vector3(...vector).normalize(), head = Math.min(HEAD[0] * px, length);
      group.quaternion.setFromUnitVectors(AXES.y, along);
      group.shaft.scale.set(SHAFT * px, Math.max(length - head, 1e-6), SHAFT * px);
      group.head.scale.set(HEAD[1] * px, head, HEAD[1] * px);
      group.head.position.set(0, length, 0);
      group.label.position.addScaledVector(along, length);
      group.label.element.textContent = `${label} ${size.toFixed(3)} N`;
    });
  }

  // ---- the view

  // from the side, slightly turned, with everything in the picture
  reset() {
    const box = new THREE.Box3(), { size } = this.fixed, middle = new THREE.Vector3();
    for (const points of [this.fixed.tube?.points || [], ...this.frame.lines, this.frame.points, this.frame.surfaces])
      for (const point of points || []) if (point) box.expandByPoint(new THREE.Vector3(...point));
    for (const [k, point] of this.frame.surfaces.entries()) if (point) box.union(new THREE.Box3().setFromCenterAndSize(new THREE.Vector3(...point), new THREE.Vector3().setScalar(this.fixed.surfaces[k].diameter)));
    box.getCenter(middle);
    const back = this.back();
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(back, 1000);
    this.camera.lookAt(middle);
    this.camera.updateMatrixWorld();
    const seen = box.clone().applyMatrix4(this.camera.matrixWorldInverse).getSize(new THREE.Vector3());
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.camera.zoom = Math.min(size ? height / size : Infinity, ROOM * width / Math.max(seen.x, 1), ROOM * height / Math.max(seen.y, 1)) / (this.isNarrow() ? PART : 1);
    this.isTurned = false;
    this.quarter = height / this.camera.zoom / 4;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.camera.updateMatrixWorld();
    this.follow();
    this.draw();
  }
  // the direction from which the first view looks: that of four which shows most of the faces of surfaces
  back() {
    const ahead = this.right.clone().cross(this.camera.up), faces = new THREE.Vector3();
    for (const { normal } of this.fixed.surfaces) faces.add(new THREE.Vector3(...normal));
    const views = [1, -1].flatMap((a) => [1, -1].map((b) => ahead.clone().applyAxisAngle(this.right, -a * TURNED[1]).applyAxisAngle(this.camera.up, b * TURNED[0])));
    return views.reduce((best, view) => (view.dot(faces) > best.dot(faces) + 1e-6 ? view : best));
  }
  zoomBy(factor) {
    this.camera.zoom *= factor;
    this.isTurned = true;
    this.camera.updateProjectionMatrix();
    this.draw();
  }
  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    this.renderer.setPixelRatio(devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.names.setSize(width, height);
    Object.assign(this.camera, { left: -width / 2, right: width / 2, top: height / 2, bottom: -height / 2 });
    this.camera.updateProjectionMatrix();
    if (this.frame && !this.isTurned) this.reset(); else this.draw();
  }

  draw() { this.due ||= requestAnimationFrame(() => { this.due = 0; this.render(); }); }
  render() {
    if (this.isStale) { this.isStale = false; this.apply(); }
    if (!this.quarter) return;
    const { zoom, right, bottom } = this.camera;
    if (zoom !== this.drawn) { this.drawn = zoom; this.shapes(); }
    this.camera.updateMatrixWorld();
    this.axes.position.set(-right + 46, bottom + 46, 0).divideScalar(zoom).applyQuaternion(this.camera.quaternion).add(this.controls.target);
    this.axes.scale.setScalar(26 / zoom);
    this.renderer.render(this.world, this.camera);
    this.placeNames();
    this.names.render(this.world, this.camera);
    this.onDraw(zoom);
  }
  // each name on the first side of its point on which it covers no point, no other name, no button, axes or scale; none without its point
  placeNames() {
    const { clientWidth: width, clientHeight: height } = this.canvas, at = new THREE.Vector3();
    const named = [...this.forces, ...this.targets, ...this.points, ...this.surfaces].filter((one) => one.label.visible).map((one) => {
      at.copy(one.label.position).project(this.camera);
      return { element: one.label.element, center: one.label.center, x: ((at.x + 1) * width) / 2, y: ((1 - at.y) * height) / 2 };
    });
    const taken = [[width - 112, 0, width, 42], [0, height - 92, 92, height], [width - 140, height - 34, width, height], ...named.map(({ x, y }) => [x - DOT, y - DOT, x + DOT, y + DOT])];
    for (const { element, center, x, y } of named) {
      const { offsetWidth: wide, offsetHeight: tall } = element, boxes = SIDES.map(([a, b]) => [x - a * wide, y - b * tall, x + (1 - a) * wide, y + (1 - b) * tall]);
      const free = boxes.findIndex((box) => box[0] > 0 && box[2] < width && box[1] > 0 && box[3] < height && !taken.some((other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3]));
      element.style.visibility = x < 0 || x > width || y < 0 || y > height ? "hidden" : "";
      center.set(...SIDES[Math.max(free, 0)]);
      taken.push(boxes[Math.max(free, 0)]);
    }
  }
  dispose() {
    cancelAnimationFrame(this.due);
    this.world.traverse((one) => { one.geometry?.dispose(); one.material?.dispose(); });
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}

// smooth tube through points [mm], (n, 3), as wide as radii [mm] at them
function tubeOf(points, radii, sides) {
  if (points.length < 2 || points.every((point) => distance(point, points[0]) < 1e-6)) return new THREE.BufferGeometry();
  const curve = new THREE.CatmullRomCurve3(points.map((point) => new THREE.Vector3(...point)));
  const steps = ROUND * (points.length - 1), tube = new THREE.TubeGeometry(curve, steps, 1, sides), at = tube.attributes.position;
  const middle = new THREE.Vector3(), corner = new THREE.Vector3();
  for (let k = 0; k <= steps; k++) {
    curve.getPointAt(k / steps, middle);
    for (let i = k * (sides + 1); i < (k + 1) * (sides + 1); i++) {
      corner.fromBufferAttribute(at, i).sub(middle).multiplyScalar(radii[Math.round(k / ROUND)]).add(middle);
      at.setXYZ(i, corner.x, corner.y, corner.z);
    }
  }
  return tube;
}

function distance(a, b) { return Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

// a piece of a sphere whose top is the origin and faces y
function capOf(diameter) {
  const radius = 1.4 * diameter;
  return new THREE.SphereGeometry(radius, 48, 12, 0, 2 * Math.PI, 0, Math.asin(diameter / 2 / radius)).translate(0, -radius, 0);
}

export default {
  template: `<div class="twin-space" role="group" :aria-label="scene.title + ', in three dimensions'">
    <canvas role="img" :aria-label="scene.title"></canvas><div class="twin-space-names" aria-hidden="true"></div>
    <div class="twin-space-tools">
      <button type="button" aria-label="reset the view" title="reset the view" @click="picture?.reset()">⌂</button>
      <button type="button" aria-label="zoom in" title="zoom in" @click="picture?.zoomBy(1.25)">+</button>
      <button type="button" aria-label="zoom out" title="zoom out" @click="picture?.zoomBy(0.8)">−</button>
    </div>
    <div class="twin-space-bar" :style="{ width: bar.px + 'px' }">{{ bar.text }}</div>
    <div class="twin-space-legend"><span v-for="one in legend" :key="one.text"><i :style="{ background: 'var(' + one.color + ')' }"></i>{{ one.text }}</span></div>
  </div>`,
  props: { number: Number, scene: Object, reached: Array },
  data: () => ({ bar: { px: 0, text: "" } }),
  computed: {
    legend() {
      const tube = this.scene.tube?.label ? [{ text: this.scene.tube.label, color: "--tissue-2" }] : [];
      return [...tube, ...this.scene.lines.map((line, k) => ({ text: line.label, color: LINES[k % LINES.length] }))];
    },
  },
  mounted() {
    const [canvas, labels] = this.$el.children;
    try { this.picture = new Picture(canvas, labels, JSON.parse(JSON.stringify(this.scene)), (zoom) => this.measure(zoom)); } catch { this.$emit("unavailable"); return; }
    canvas.addEventListener("webglcontextlost", () => { if (!this.gone) this.$emit("unavailable"); });
    this.onTick = (state) => { if (state.space && !document.hidden) this.picture.move(state.space, this.reached); };
    channel.listeners.add(this.onTick);
    channel.show(this.number);
    this.sizes = new ResizeObserver(() => this.picture.resize());
    this.sizes.observe(this.$el);
    this.theme = new MutationObserver(() => this.picture.recolor());
    this.theme.observe(document.body, { attributeFilter: ["class"] });
    this.$el.picture = this.picture;  // for tests
  },
  unmounted() {
    this.gone = true;
    if (!this.picture) return;
    channel.listeners.delete(this.onTick);
    channel.show(null);
    this.sizes.disconnect();
    this.theme.disconnect();
    this.picture.dispose();
  },
  methods: {
    // the largest step that is at most 120 px long
    measure(zoom) {
      const step = STEPS.findLast((one) => one * zoom <= 120) || STEPS[0];
      this.bar = { px: step * zoom, text: `${step} mm` };
    },
  },
};
