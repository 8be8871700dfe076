"use strict";
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
  const draw = () => {
    const fitting = spec.layouts.filter((layout) => layout.least <= plot.clientWidth).pop() || spec.layouts[0];
    if (fitting === used) return Plotly.Plots.resize(plot).then(point);
    used = fitting;
    const layout = structuredClone({ ...spec.layout, ...fitting.layout });
    plot.style.height = layout.height + "px";
    return Plotly.react(plot, spec.data, layout, { displayModeBar: false }).then(point);
  };
  draw().then(() => {
    plot.on("plotly_relayout", point);
    if (cursors.length) plot.on("plotly_click", ({ points: [first] }) => { if (spec.clocks.some(([x]) => plot._fullLayout[x] === first.xaxis)) clock.set(first.x); });
  });
  new ResizeObserver(draw).observe(plot);
  for (const button of figure.querySelectorAll(".legend button")) {
    button.addEventListener("click", () => {
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
