"use strict";
/* The robot in three dimensions, and the clock that it shares with the figures: joints are turned here, from their origins and axes. */
const clock = { t: 0, from: 0, to: 0, listeners: [], set(t) { this.t = Math.min(Math.max(t, this.from), this.to); for (const f of this.listeners) f(this.t); } };

for (const host of document.querySelectorAll(".robot")) {
  const scene = JSON.parse(host.querySelector("script").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const columns = (of, text) => {
    const raw = new Uint16Array(bytes(text)), n = of.low.length, out = new Float32Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = of.low[i % n] + of.step[i % n] * raw[i];
    return out;
  };
  const tracks = scene.tracks.map((track) => ({ t: new Float32Array(bytes(track.t)), q: columns(track, track.q), turned: track.orientation ? new Float32Array(bytes(track.orientation)) : null }));
  clock.from = Math.min(...tracks.map((track) => track.t[0]));
  clock.to = Math.max(...tracks.map((track) => track.t[track.t.length - 1]));
  clock.t = clock.from;

  /* the tree: a group that stands where the joint is, and one in it that the joint moves */
  const world = new THREE.Scene(), base = new THREE.Group();
  world.add(base);
  const axes = scene.joints.map((joint) => new THREE.Vector3(...joint.axis));
  const moving = [];
  for (const joint of scene.joints) {
    const [a, b, c, d, e, f, g, h, i] = joint.rotation, still = new THREE.Group(), moved = new THREE.Group();
    still.position.set(...joint.origin);
    still.quaternion.setFromRotationMatrix(new THREE.Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1));
    still.add(moved);
    (joint.parent < 0 ? base : moving[joint.parent]).add(still);
    moving.push(moved);
  }
  const of = (joint) => (joint < 0 ? base : moving[joint]);
  const turn = new THREE.Quaternion();
  function pose(k, t) {
    const { t: times, q, turned } = tracks[k], n = axes.length;
    let low = 0, high = times.length - 1;
    while (high - low > 1) { const middle = (low + high) >> 1; if (times[middle] <= t) low = middle; else high = middle; }
    const part = Math.min(Math.max((t - times[low]) / Math.max(times[high] - times[low], 1e-9), 0), 1);
    for (let j = 0; j < n; j++) {
      const value = q[n * low + j] + part * (q[n * high + j] - q[n * low + j]);
      if (scene.joints[j].slides) moving[j].position.copy(axes[j]).multiplyScalar(value);
      else moving[j].quaternion.setFromAxisAngle(axes[j], value);
    }
    if (turned) base.quaternion.fromArray(turned, 4 * low).slerp(turn.fromArray(turned, 4 * high), part).normalize();
    base.updateMatrixWorld(true);
  }

  /* what is seen */
  const ringsOf = [], bodies = [], grey = [];
  for (const shape of scene.shapes) {
    let geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(columns(shape, shape.vertices), 3));
    geometry.setIndex(new THREE.BufferAttribute(new Uint16Array(bytes(shape.triangles)), 1));
    geometry = THREE.toCreasedNormals(geometry, 0.7);
    const material = new THREE.MeshStandardMaterial({ color: shape.colour, roughness: 0.75, metalness: 0.05, side: THREE.DoubleSide });
    grey.push({ material, given: new THREE.Color(shape.colour) });
    of(shape.joint).add(new THREE.Mesh(geometry, material));
  }
  const up = new THREE.Vector3(0, 0, 1), sideways = new THREE.Quaternion();
  const coloured = scene.colourings.length > 0, marked = new Set(scene.rings.flatMap((ring) => ring.joints));
  scene.joints.forEach((joint, j) => {
    if (!coloured && !marked.has(j)) return void ringsOf.push(null);
    const thick = 0.011 * scene.size * (marked.has(j) ? 1.6 : 1), length = 2.4 * joint.ring;
    const shape = joint.slides ? new THREE.CylinderGeometry(2 * thick, 2 * thick, length, 20).rotateX(Math.PI / 2) : new THREE.TorusGeometry(joint.ring, thick, 12, 48);
    const solid = new THREE.MeshStandardMaterial({ roughness: 0.5 });
    const through = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.3, depthTest: false });
    sideways.setFromUnitVectors(up, axes[j]);
    for (const material of [solid, through]) {
      const ring = new THREE.Mesh(shape, material);
      ring.quaternion.copy(sideways);
      moving[j].add(ring);
    }
    ringsOf.push([solid, through]);
  });
  for (const body of scene.ellipsoids) {
    const [a, b, c, d, e, f, g, h, i] = body.rotation, group = new THREE.Group(), ball = new THREE.SphereGeometry(1, 32, 20);
    group.position.set(...body.position);
    group.quaternion.setFromRotationMatrix(new THREE.Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1));
    const solid = new THREE.Mesh(ball, new THREE.MeshStandardMaterial({ color: "#D55E00", transparent: true, opacity: 0.75, roughness: 0.6 }));
    const through = new THREE.Mesh(ball, new THREE.MeshBasicMaterial({ color: "#D55E00", transparent: true, opacity: 0.25, depthTest: false }));
    for (const mesh of [solid, through]) { mesh.scale.set(...body.axes); group.add(mesh); }
    if (body.outline) {
      for (const around of [[0, 0], [Math.PI / 2, 0], [0, Math.PI / 2]]) {
        const points = Array.from({ length: 64 }, (_, k) => new THREE.Vector3(Math.cos(k * Math.PI / 32), Math.sin(k * Math.PI / 32), 0));
        const line = new THREE.LineLoop(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ color: "#D55E00", depthTest: false, transparent: true }));
        line.rotation.set(around[0], around[1], 0);
        const round = new THREE.Group();
        round.add(line);
        round.scale.set(...body.outline);
        group.add(round);
      }
    }
    of(body.joint).add(group);
    bodies.push({ body, group });
  }

  /* words beside it */
  const labels = host.querySelector(".labels"), worded = [];
  const label = (text, at) => {
    if (!text) return;
    const element = document.createElement("span");
    element.textContent = text;
    labels.append(element);
    worded.push({ element, at });
  };
  for (const ring of scene.rings) if (ring.joints.length) label(ring.label, moving[ring.joints[0]]);
  for (const { body, group } of bodies) label(body.label, group);

  /* colours */
  const scale = scene.colours.map((text) => new THREE.Color(text)), unknown = new THREE.Color("#9AA3AE"), found = new THREE.Color("#D55E00");
  const colourOf = (value, most) => {
    if (value === null) return unknown;
    const at = Math.min(Math.max(value / most, 0), 1) * (scale.length - 1), k = Math.min(Math.floor(at), scale.length - 2);
    return scale[k].clone().lerp(scale[k + 1], at - k);
  };
  let shownTrack = 0;
  function colour(k) {
    const chosen = scene.colourings[k];
    ringsOf.forEach((materials, j) => { if (materials) for (const material of materials) material.color.copy(chosen ? colourOf(chosen.values[j], chosen.most) : found); });
  }
  colour(0);

  /* the picture */
  const stage = host.querySelector(".stage");
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas: host.querySelector("canvas"), antialias: true, alpha: true, preserveDrawingBuffer: true });
  } catch (error) {
    host.classList.add("flat");
  }
  const camera = new THREE.PerspectiveCamera(32, 1, 0.01 * scene.size, 50 * scene.size);
  camera.up.set(0, 0, 1);
  const sky = new THREE.HemisphereLight("#ffffff", "#8a8f98", 1.9), sun = new THREE.DirectionalLight("#ffffff", 1.8);
  sun.position.set(2, -1.5, 4);
  world.add(sky, sun);
  let floor = null;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let printing = false;
  function theme() {
    const night = dark.matches && !printing;
    if (floor) world.remove(floor);
    floor = new THREE.GridHelper(3 * scene.size, 12, night ? "#4a5464" : "#b9c1cb", night ? "#2b333f" : "#dde2e8");
    floor.rotation.x = Math.PI / 2;
    floor.position.z = low;
    world.add(floor);
    /* a black link on black paper would not be seen */
    for (const { material, given } of grey) material.color.copy(given).lerp(new THREE.Color("#9aa4b1"), night ? 0.35 : 0.12);
    draw();
  }
  /* all that it reaches, seen from the side and a little from above */
  const lowest = new THREE.Vector3(Infinity, Infinity, Infinity), highest = lowest.clone().negate(), at = new THREE.Vector3();
  for (let k = 0; k < 60; k++) {
    pose(0, clock.from + (k / 59) * (clock.to - clock.from));
    for (const group of [base, ...moving, ...bodies.map((one) => one.group)]) { at.setFromMatrixPosition(group.matrixWorld); lowest.min(at); highest.max(at); }
  }
  const middle = lowest.clone().add(highest).multiplyScalar(0.5), wide = Math.max(highest.distanceTo(lowest), 0.4 * scene.size) + 0.15 * scene.size;
  const low = Math.min(0, lowest.z - (tracks[0].turned ? 0.06 * scene.size : 0));
  camera.position.set(middle.x + 1.0 * wide, middle.y - 0.9 * wide, middle.z + 0.5 * wide);
  const controls = renderer && new THREE.OrbitControls(camera, renderer.domElement);
  if (controls) {
    controls.target.copy(middle);
    /* the wheel scrolls the page; with Ctrl it comes nearer */
    controls.enableZoom = true;
    renderer.domElement.addEventListener("wheel", (event) => { if (!event.ctrlKey && !event.metaKey) event.stopImmediatePropagation(); }, { capture: true });
    controls.update();
    controls.addEventListener("change", () => draw());
  }
  const projected = new THREE.Vector3();
  function draw() {
    if (!renderer) return;
    renderer.render(world, camera);
    for (const { element, at } of worded) {
      projected.setFromMatrixPosition(at.matrixWorld).project(camera);
      element.hidden = !at.visible || Math.abs(projected.z) > 1;
      const x = (0.5 + 0.5 * projected.x) * stage.clientWidth, left = x + 14 + element.offsetWidth > stage.clientWidth;
      element.style.transform = `translate(${left ? x - 14 - element.offsetWidth : x + 14}px, ${(0.5 - 0.5 * projected.y) * stage.clientHeight - 12}px)`;
    }
  }
  function show(t) {
    pose(shownTrack, t);
    for (const { body, group } of bodies) group.visible = (body.start === null || t >= body.start) && (body.end === null || t < body.end);
    draw();
  }
  clock.listeners.push(show);
  for (const choice of host.querySelectorAll(".choice")) {
    choice.addEventListener("click", (event) => {
      const button = event.target.closest("button");
      if (!button) return;
      for (const other of choice.querySelectorAll("button")) other.setAttribute("aria-pressed", other === button);
      const k = Number(button.dataset.index);
      if (choice.dataset.of === "track") shownTrack = k;
      else { colour(k); host.querySelectorAll(".scale").forEach((one, i) => (one.hidden = i !== k)); }
      show(clock.t);
    });
  }
  if (renderer) {
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    new ResizeObserver(() => {
      renderer.setSize(stage.clientWidth, stage.clientHeight, false);
      camera.aspect = stage.clientWidth / Math.max(stage.clientHeight, 1);
      /* a narrow picture needs to be seen from farther off */
      camera.fov = camera.aspect < 1 ? 32 / camera.aspect : 32;
      camera.updateProjectionMatrix();
      draw();
    }).observe(stage);
    dark.addEventListener("change", theme);
    addEventListener("beforeprint", () => { printing = true; theme(); });
    addEventListener("afterprint", () => { printing = false; theme(); });
    theme();
  }
  show(clock.t);
  /* where the joints are in the base, row by row, for scripts and tests */
  window.robotView = {
    placements(t, k = shownTrack) {
      pose(k, t);
      const inverse = base.matrixWorld.clone().invert();
      const out = moving.map((group) => inverse.clone().multiply(group.matrixWorld).transpose().elements.slice());
      show(clock.t);
      return out;
    },
  };
}

/* the clock */
const bar = document.querySelector(".clock");
if (bar) {
  const slider = bar.querySelector("input"), told = bar.querySelector("output"), button = bar.querySelector(".play"), pace = bar.querySelector(".pace");
  let before = null;
  slider.min = clock.from; slider.max = clock.to; slider.step = "any"; slider.value = clock.t;
  clock.listeners.push((t) => { slider.value = t; told.textContent = `${t.toFixed(2)} s`; });
  slider.addEventListener("input", () => clock.set(Number(slider.value)));
  const step = (now) => {
    if (before === null) return;
    const t = clock.t + Number(pace.dataset.times) * (now - before) / 1000;
    before = now;
    if (t >= clock.to) { clock.set(clock.to); play(false); } else { clock.set(t); requestAnimationFrame(step); }
  };
  const play = (running) => {
    before = running ? performance.now() : null;
    button.textContent = running ? "❚❚" : "▶";
    button.setAttribute("aria-label", running ? "Pause" : "Play");
    if (running) { if (clock.t >= clock.to) clock.set(clock.from); requestAnimationFrame(step); }
  };
  button.addEventListener("click", () => play(before === null));
  pace.addEventListener("click", () => { pace.dataset.times = { 1: 2, 2: 5, 5: 1 }[pace.dataset.times]; pace.textContent = `${pace.dataset.times}×`; });
  clock.set(clock.t);
}
