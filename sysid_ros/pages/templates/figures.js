"use strict";
/* A figure is drawn when it comes near, or when there is nothing else to do: a page with many opens at once. */
const waiting = new Map();
const near = new IntersectionObserver((entries) => { for (const { target, isIntersecting } of entries) if (isIntersecting) begin(target); }, { rootMargin: "500px" });
function begin(plot) {
  near.unobserve(plot);
  waiting.get(plot)?.();
  waiting.delete(plot);
}
const idle = window.requestIdleCallback || ((f) => setTimeout(f, 200));
const rest = () => { for (const plot of waiting.keys()) { begin(plot); idle(rest); return; } };
window.addEventListener("beforeprint", () => { for (const plot of [...waiting.keys()]) begin(plot); });
window.addEventListener("load", () => idle(rest));
for (const figure of document.querySelectorAll("figure")) {
  const plot = figure.querySelector(".plot");
  const spec = JSON.parse(figure.querySelector("script").textContent);
  for (const trace of spec.data) {
    if (trace.type === "scatter") { trace.x = spec.arrays[trace.x]; trace.y = spec.arrays[trace.y]; }
  }
  /* a line in every panel over the clock's time: an element above the plot, which costs nothing to move */
  const cursors = clock.to > clock.from ? spec.clocks.map(([x, y]) => {
    const line = document.createElement("i");
    line.className = "cursor";
    plot.before(line);
    return { line, x, y };
  }) : [];
  const point = () => {
    for (const { line, x, y } of cursors) {
      const across = plot._fullLayout?.[x], upright = plot._fullLayout?.[y];
      if (!across) continue;
      const at = across.d2p(clock.t);
      line.hidden = !(at >= 0 && at <= across._length);
      line.style.transform = `translate(${across._offset + at}px, ${plot.offsetTop + upright._offset}px)`;
      line.style.height = `${upright._length}px`;
    }
  };
  clock.listeners.push(point);
  let used = null;
  const fits = () => spec.layouts.filter((layout) => layout.least <= plot.clientWidth).pop() || spec.layouts[0];
  const draw = () => {
    const fitting = fits();
    if (fitting === used) return Plotly.Plots.resize(plot).then(point);
    used = fitting;
    const layout = structuredClone({ ...spec.layout, ...fitting.layout });
    plot.style.height = layout.height + "px";
    /* on paper no figure is higher than a page */
    plot.style.setProperty("--shrink", Math.min(0.6, 860 / layout.height));
    return Plotly.react(plot, spec.data, layout, { displayModeBar: false }).then(point);
  };
  plot.style.height = fits().layout.height + "px";
  waiting.set(plot, () => {
    draw().then(() => {
      plot.on("plotly_relayout", point);
      if (cursors.length) plot.on("plotly_click", ({ points: [first] }) => { if (spec.clocks.some(([x]) => plot._fullLayout[x] === first.xaxis)) clock.set(first.x); });
    });
    new ResizeObserver(draw).observe(plot);
  });
  near.observe(plot);
  for (const button of figure.querySelectorAll(".legend button")) {
    button.addEventListener("click", () => {
      begin(plot);
      const shown = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", shown);
      const label = button.dataset.label;
      const traces = spec.data.flatMap((trace, k) => (trace.meta === label ? [k] : []));
      if (traces.length) Plotly.restyle(plot, { visible: shown }, traces);
      const shapes = spec.layout.shapes.flatMap((shape, k) => (shape.name === label ? [[`shapes[${k}].visible`, shown]] : []));
      if (shapes.length) Plotly.relayout(plot, Object.fromEntries(shapes));
    });
  }
}
