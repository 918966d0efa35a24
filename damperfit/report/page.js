"use strict";
(() => {
  const { arrays, plots, colours } = JSON.parse(document.getElementById("data").textContent);
  const off = new Set();
  const drawn = new Set();
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const WIDTHS = { solid: 2, wide: 4, thin: 1, dashed: 1.5, dotted: 1.5 };
  const DASHES = { dashed: "dash", dotted: "dot" };
  let printing = false;

  const decoded = new Map();
  const array = (place) => {
    if (place === null) return undefined;
    if (!decoded.has(place)) {
      const bytes = Uint8Array.from(atob(arrays[place]), (c) => c.charCodeAt(0));
      const view = new DataView(bytes.buffer);
      decoded.set(place, Float32Array.from({ length: bytes.length / 4 }, (_, i) => view.getFloat32(4 * i, true)));
    }
    return decoded.get(place);
  };

  const theme = () => dark.matches && !printing
    ? { ink: "#e6e9ef", muted: "#9aa5b5", paper: "#14181f", grid: "#2c3442" }
    : { ink: "#1c2330", muted: "#7d8796", paper: "#ffffff", grid: "#e3e7ed" };

  const label = ([name, unit]) => (unit ? `${name}, ${unit}` : name);

  function points(line, panel) {
    let x = array(line.x), y = array(line.y);
    if (line.setting === null && panel.x[0] === "setting" && off.size) {
      const kept = [...x.keys()].filter((i) => !off.has(x[i]));
      x = kept.map((i) => x[i]);
      y = kept.map((i) => y[i]);
    }
    return [x, y];
  }

  function trace(line, panel, row, look) {
    const colour = look[line.colour] || line.colour;
    const marks = line.style === "points" || line.style === "triangles";
    const few = array(line.x).length <= 60;
    const [x, y] = points(line, panel);
    const one = {
      type: "scatter", x, y, name: line.label,
      mode: marks ? "markers" : "lines",
      xaxis: "x", yaxis: row ? `y${row + 1}` : "y",
      showlegend: line.legend,
      meta: line.setting,
      hovertemplate: `${line.label}<br>${panel.x[0]} %{x:.4~g} ${panel.x[1]}<br>${panel.y[0]} %{y:.5~g} ${panel.y[1]}<extra></extra>`,
    };
    if (marks) one.marker = { color: colour, size: few ? 8 : 3, symbol: line.style === "points" ? "circle" : "triangle-up-open", line: { width: 2, color: colour } };
    if (marks && !few) one.marker.line.width = 0;
    if (!marks) one.line = { color: colour, width: WIDTHS[line.style], dash: DASHES[line.style] || "solid" };
    if (line.up !== null) one.error_y = { type: "data", symmetric: false, array: [...array(line.up)], arrayminus: [...array(line.down)], color: colour, thickness: 1.5, width: 4 };
    return one;
  }

  function axes(plot, look) {
    const n = plot.panels.length;
    const common = { gridcolor: look.grid, zerolinecolor: look.muted, linecolor: look.muted, automargin: true };
    const layout = { xaxis: { ...common, title: { text: label(plot.panels[n - 1].x) }, anchor: n > 1 ? `y${n}` : "y" } };
    if (plot.panels[0].x[0] === "setting" && Object.keys(colours).length <= 8) layout.xaxis.dtick = 1;
    plot.panels.forEach((panel, row) => {
      // The upper panel takes the larger part.
      const domain = n === 1 ? [0, 1] : row === 0 ? [0.42, 1] : [0, 0.34];
      layout[row ? `yaxis${row + 1}` : "yaxis"] = { ...common, title: { text: label(panel.y) }, domain, type: panel.log ? "log" : "linear", exponentformat: "power", ...(panel.log ? { dtick: 1 } : {}) };
    });
    return layout;
  }

  function marks(plot, look) {
    const shapes = [], annotations = [];
    plot.panels.forEach((panel, row) => {
      const yref = row ? `y${row + 1}` : "y";
      for (const [y, word] of panel.rules) {
        shapes.push({ type: "line", xref: "paper", x0: 0, x1: 1, yref, y0: y, y1: y, line: { color: look.muted, width: 1, dash: "dot" } });
        if (word) annotations.push({ xref: "paper", x: 1, xanchor: "right", yref, y: panel.log ? Math.log10(y) : y, yanchor: "bottom", text: word, showarrow: false, font: { size: 11, color: look.muted } });
      }
      for (const [x0, x1] of panel.bands) {
        shapes.push({ type: "rect", xref: "x", x0, x1, yref: `${yref} domain`, y0: 0, y1: 1, fillcolor: "#d55e00", opacity: 0.2, line: { width: 0 }, layer: "below" });
      }
    });
    return { shapes, annotations };
  }

  function draw(place) {
    const plot = plots[place], div = document.getElementById(`plot-${place}`), look = theme();
    const data = plot.panels.flatMap((panel, row) =>
      panel.lines.filter((line) => !off.has(line.setting)).map((line) => trace(line, panel, row, look)));
    const shown = data.filter((one) => one.showlegend).length;
    const layout = {
      ...axes(plot, look), ...marks(plot, look),
      paper_bgcolor: look.paper, plot_bgcolor: look.paper,
      font: { color: look.ink, size: printing ? 10 : 12 },
      margin: { l: 60, r: 12, t: printing ? 24 : 50, b: 44 },
      showlegend: shown > 1,
      legend: shown > 6 && !printing ? { font: { size: 10 } } : { orientation: "h", y: 1.02, yanchor: "bottom", font: { size: printing ? 7 : 11 } },
      hovermode: "closest",
      uirevision: plot.name,  // a zoom survives switching
    };
    if (printing) Object.assign(layout, { width: 340, height: 245, showlegend: shown > 1 && shown <= 6 });
    drawn.add(place);
    return Plotly.react(div, data, layout, { responsive: true, displaylogo: false, displayModeBar: "hover", modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]], toImageButtonOptions: { format: "svg", filename: plot.name } });
  }

  const section = (place) => document.getElementById(`plot-${place}`).closest("section");

  function drawAll() {
    plots.forEach((_, place) => { if (!drawn.has(place) && !section(place).hidden) draw(place); });
  }

  // What is seen is drawn first, the rest while the page rests.
  const queue = plots.keys();
  const rest = window.requestIdleCallback || ((work) => setTimeout(work, 10));
  function step() {
    for (const place of queue) {
      if (drawn.has(place) || section(place).hidden) continue;
      draw(place);
      rest(step);
      return;
    }
    document.documentElement.dataset.drawn = "all";
  }
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const place = Number(entry.target.id.slice(5));
      if (entry.isIntersecting && !drawn.has(place)) draw(place);
    }
  }, { rootMargin: "200px" });
  plots.forEach((_, place) => watcher.observe(document.getElementById(`plot-${place}`)));
  requestAnimationFrame(() => setTimeout(() => rest(step), 0));

  function redraw() {
    drawn.forEach((place) => { if (!section(place).hidden) draw(place); });
  }

  function switched() {
    document.querySelectorAll("section.log").forEach((one) => { one.hidden = off.has(Number(one.dataset.setting)); });
    plots.forEach((_, place) => {
      if (section(place).hidden && drawn.delete(place)) Plotly.purge(`plot-${place}`);
    });
    redraw();
    drawAll();
  }
  const boxes = [...document.querySelectorAll("nav input")];
  function set(box, on) {
    box.checked = on;
    const setting = Number(box.dataset.setting);
    if (on) off.delete(setting); else off.add(setting);
  }
  boxes.forEach((box) => box.addEventListener("change", () => { set(box, box.checked); switched(); }));
  document.getElementById("all").addEventListener("click", () => { boxes.forEach((box) => set(box, true)); switched(); });
  document.getElementById("none").addEventListener("click", () => { boxes.forEach((box) => set(box, false)); switched(); });

  dark.addEventListener("change", redraw);
  addEventListener("beforeprint", () => { printing = true; redraw(); drawAll(); });
  addEventListener("afterprint", () => { printing = false; redraw(); });
  window.damperfit = { plots, colours, drawAll };
})();
