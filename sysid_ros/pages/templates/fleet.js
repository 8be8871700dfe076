"use strict";
// A robot, one of its joints and one of its bags, where they are chosen; what is chosen stands in the address.
const fleet = JSON.parse(document.getElementById("fleet").textContent);
const chosen = document.getElementById("chosen");
const DAY = 86400000, START = Date.parse(fleet.start);
const dated = day => new Date(START + day * DAY).toISOString().slice(0, 10);
const known = x => x !== null && x !== undefined;

function element(name, attributes, ...children) {
  const svg = ["svg", "path", "circle", "line", "rect", "text"].includes(name);
  const made = svg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes || {})) {
    if (key === "onclick") made.addEventListener("click", value); else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

// Days and values of a curve of a joint: what is at its bags, or what a robot carries.
function curve(robot, joint, q) {
  if (!joint) return { days: robot.days, y: robot.mass, std: robot.mass_std, level: [], spread: [], at: robot.days.map((_, k) => k), odd: [] };
  const [y, std, level, spread] = joint.curves[q];
  return { days: joint.at.map(k => robot.days[k]), y, std, level, spread, at: joint.at, odd: joint.odd };
}

function range(c) {
  const values = [];
  c.y.forEach((y, k) => { if (known(y)) values.push(y); if (known(c.level[k])) values.push(c.level[k] + 2 * c.spread[k], c.level[k] - 2 * c.spread[k]); });
  if (!values.length) return [0, 1];
  const low = Math.min(...values), high = Math.max(...values), room = 0.06 * (high - low) || Math.abs(high) * 0.05 || 1;
  return [low - room, high + room];
}

const told = (robot, joint, quantity) => fleet.alarms.filter(a => a.robot === robot && (joint === null || a.joint === joint) && (!quantity || a.quantity === quantity));

function draw(c, alarms, box, details) {
  const [left, top, width, height] = box, [low, high] = range(c), whole = fleet.last || 1;
  const x = day => left + width * day / whole, y = value => top + height * (1 - (value - low) / (high - low));
  const out = [];
  for (const a of alarms) {
    const from = x(a.day[1]), to = Math.max(x(a.day[2]), from + 2);
    out.push(element("rect", { class: "alarmed", "data-of": a.quantity, x: from, y: top, width: to - from, height }));
    out.push(element("line", { class: "alarmline", "data-of": a.quantity, x1: x(a.day[0]), x2: x(a.day[0]), y1: top, y2: top + height }));
  }
  const some = c.days.map((_, k) => k).filter(k => known(c.level[k]));
  if (some.length) {
    const line = (k, sign) => `${x(c.days[k]).toFixed(1)},${y(c.level[k] + sign * 2 * c.spread[k]).toFixed(1)}`;
    out.push(element("path", { class: "band", d: "M" + some.map(k => line(k, 1)).join("L") + "L" + some.reverse().map(k => line(k, -1)).join("L") + "Z" }));
    out.push(element("path", { class: "level", d: "M" + some.reverse().map(k => line(k, 0)).join("L") }));
  }
  if (details) c.days.forEach((day, k) => {
    if (known(c.y[k]) && known(c.std[k])) out.push(element("line", { class: "std", x1: x(day), x2: x(day), y1: y(c.y[k] - 2 * c.std[k]), y2: y(c.y[k] + 2 * c.std[k]) }));
  });
  c.days.forEach((day, k) => {
    if (!known(c.y[k])) return;
    const odd = c.odd.includes(k), point = element("circle", { class: odd ? "bag odd" : "bag", cx: x(day).toFixed(1), cy: y(c.y[k]).toFixed(1), r: details ? 3.2 : 1 });
    if (details) { point.append(element("title", {}, `${dated(day)}: ${c.y[k]} ± ${c.std[k]}`)); point.addEventListener("click", () => details(k, point)); }
    out.push(point);
  });
  return { out, x, y, low, high };
}

function ticks(low, high, count) {
  const step = 10 ** Math.floor(Math.log10((high - low) / count)), fit = [1, 2, 5, 10].find(f => (high - low) / (f * step) <= count) * step, out = [];
  for (let v = Math.ceil(low / fit) * fit; v <= high; v += fit) out.push([v, v.toFixed(Math.max(0, -Math.floor(Math.log10(fit) + 1e-9)))]);
  return out;
}

function chart(robot, joint, q, below) {
  const quantity = fleet.quantities[q], width = Math.max(300, chosen.clientWidth - 44), height = 300, c = curve(robot, joint, q);
  const svg = element("svg", { class: "chart", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": quantity.words });
  const alarms = told(robot.name, joint ? joint.name : "", quantity.name), box = [58, 14, width - 70, height - 44];
  const { out, x, y, low, high } = draw(c, alarms, box, (k, point) => { svg.querySelectorAll(".picked").forEach(p => p.classList.remove("picked")); point.classList.add("picked"); bag(robot, c, k, quantity, below); });
  for (const [v, text] of ticks(low, high, 5)) svg.append(element("line", { class: "grid", x1: 58, x2: width - 12, y1: y(v), y2: y(v) }), element("text", { x: 52, y: y(v) + 4, "text-anchor": "end" }, text));
  const count = Math.max(2, Math.min(8, Math.floor(width / 130)));
  for (let i = 0; i <= count; i++) { const day = fleet.last * i / count; svg.append(element("text", { x: x(day), y: height - 12, "text-anchor": i === 0 ? "start" : i === count ? "end" : "middle" }, dated(day))); }
  svg.append(...out);
  return svg;
}

function bag(robot, c, k, quantity, below) {
  const path = robot.bags[c.at[k]];
  below.replaceChildren(
    element("h3", {}, `Bag of ${dated(c.days[k])}`), element("p", { class: "note" }, `${quantity.words} ${c.y[k]} ± ${c.std[k]} ${quantity.unit}${c.odd.includes(k) ? "; an odd bag: it is left out of the trend" : ""}`),
    element("pre", {}, `${path}\n\nsysid diagnose '${path}' --out report/`));
}

function alarmText(a) {
  const box = element("div", { class: "alarm", "data-of": a.quantity }, element("b", {}, a.what), ` since ${a.since} (95 %: ${a.from} to ${a.to}), ${a.how}. Something changed: ${a.probability}; it is this: ${a.of_kind}${a.others.length ? ", else " + a.others.join(" or ") : ""}. It costs ${a.cost}. Look at: ${a.look}.`);
  if (a.commands.length) box.append(element("details", {}, element("summary", {}, `Bags before and after, and what to give (${a.before.length} and ${a.after.length})`), element("pre", {}, `before\n${a.before.join("\n")}\n\nafter\n${a.after.join("\n")}\n\n${a.commands.join("\n")}`)));
  return box;
}

let current = ["", "", -1];  // robot, joint and quantity that are shown
function show(name, jointName, q) {
  current = [name, jointName, q];
  const robot = fleet.robots.find(r => r.name === name);
  document.querySelectorAll("a.lane").forEach(a => a.toggleAttribute("aria-current", decodeURIComponent(a.hash.slice(1)) === name));
  chosen.hidden = !robot;
  if (!robot) return;
  const parts = [element("h2", {}, robot.name), element("p", { class: "note" }, `Kind ${robot.kind}, ${robot.days.length} bags, ${dated(robot.days[0])} to ${dated(robot.days[robot.days.length - 1])}. The line is the trend with its 95 % region, without what temperature and load do; a point is a bag.`)];
  parts.push(...told(name, null).map(alarmText));
  if (robot.joints.length) {
    const grid = element("div", { class: "sparks" }, element("span"), ...fleet.quantities.slice(0, -1).map(k => element("span", {}, `${k.words} [${k.unit}]`)));
    const below = element("div"), big = element("div");
    const open = (joint, i, button) => {
      grid.querySelectorAll("button").forEach(b => b.setAttribute("aria-pressed", b === button));
      below.replaceChildren();
      current = [name, joint ? joint.name : "", i];
      big.replaceChildren(element("h3", {}, `${fleet.quantities[i].words}${joint ? " of " + joint.name : ""} [${fleet.quantities[i].unit}]`), chart(robot, joint, i, below));
    };
    let first = null;
    const add = (joint, i) => {
      const quantity = fleet.quantities[i], svg = element("svg", { viewBox: "0 0 100 40", preserveAspectRatio: "none" });
      const alarms = told(name, joint ? joint.name : "", quantity.name);
      svg.append(...draw(curve(robot, joint, i), alarms, [2, 3, 96, 34], null).out);
      const button = element("button", { type: "button", class: alarms.length ? "told" : "", "data-of": quantity.name, "aria-label": `${quantity.words}${joint ? " of " + joint.name : ""}`, onclick: () => open(joint, i, button) }, svg);
      grid.append(button);
      const here = (joint ? joint.name : "") === jointName, exact = q >= 0 && q === i && here, wanted = jointName && here && q < 0;
      if (first && first.exact) return;
      if (!first || exact || (alarms.length && !first.told) || (wanted && (alarms.length || !first.wanted))) first = { joint, i, button, told: alarms.length, wanted, exact };
    };
    for (const joint of robot.joints) { grid.append(element("span", {}, joint.name)); fleet.quantities.slice(0, -1).forEach((_, i) => add(joint, i)); }
    if (robot.mass.some(known)) { grid.append(element("span", {}, "at the tip [kg]")); add(null, fleet.quantities.length - 1); }
    parts.push(element("div", { class: "scroll" }, grid), big, below);
    chosen.replaceChildren(...parts);
    open(first.joint, first.i, first.button);
  } else {
    parts.push(element("p", {}, "Its curves are not in this page."));
    chosen.replaceChildren(...parts);
  }
}

function fromAddress() {
  const [name, joint] = decodeURIComponent(location.hash.slice(1)).split("/");
  show(name, joint || "", -1);
  if (!chosen.hidden) chosen.scrollIntoView({ block: "start" });
}
const waiting = new Set();  // as on the pages with figures: nothing is drawn later
window.addEventListener("hashchange", fromAddress);
window.addEventListener("resize", () => show(...current));
if (location.hash) fromAddress(); else if (fleet.alarms.length) show(fleet.alarms[0].robot, "", -1);
