"use strict";
for (const figure of document.querySelectorAll("figure")) {
  const plot = figure.querySelector(".plot");
  const spec = JSON.parse(figure.querySelector("script").textContent);
  for (const trace of spec.data) {
    if (trace.type === "scatter") { trace.x = spec.arrays[trace.x]; trace.y = spec.arrays[trace.y]; }
  }
  let used = null;
  const draw = () => {
    const fitting = spec.layouts.filter((layout) => layout.least <= plot.clientWidth).pop() || spec.layouts[0];
    if (fitting === used) return Plotly.Plots.resize(plot);
    used = fitting;
    const layout = structuredClone({ ...spec.layout, ...fitting.layout });
    plot.style.height = layout.height + "px";
    return Plotly.react(plot, spec.data, layout, { displayModeBar: false });
  };
  draw();
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
