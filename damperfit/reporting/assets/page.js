"use strict";
(() => {
  const { arrays, plots, colours } = JSON.parse(document.getElementById("data").textContent);
  const off = new Set();
  const drawn = new Set();
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const WIDTHS = { solid: 2, wide: 4, thin: 0.9, pale: 1.5, faint: 0.6, dashed: 1.5, dotted: 1.5, dot_line: 1, triangle_line: 1 };
  const DASHES = { dashed: "dash", dotted: "dot", triangle_line: "dash" };
  const SYMBOLS = { points: "circle", triangles: "triangle-up-open", rings: "circle-open", dot_line: "circle", triangle_line: "triangle-up-open" };
  const JOINED = new Set(["dot_line", "triangle_line"]);
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
      const kept = [...x.keys()].filter((i) => !off.has(panel.names ? panel.names[x[i] - 1] : String(x[i])));
      x = kept.map((i) => x[i]);
      y = kept.map((i) => y[i]);
    }
    return [x, y];
  }

  const marked = (line) => line.style in SYMBOLS;

  function trace(line, panel, row, look, keyed) {
    const colour = look[line.colour] || line.colour;
    const few = array(line.x).length <= 60;
    const [x, y] = points(line, panel);
    const trace = {
      type: "scatter", x, y, name: line.label,
      mode: marked(line) ? (JOINED.has(line.style) ? "lines+markers" : "markers") : "lines",
      xaxis: "x", yaxis: row ? `y${row + 1}` : "y",
      showlegend: line.legend && !keyed,
      meta: line.setting,
      hovertemplate: `${line.label}<br>${panel.x[0]} %{x:.4~g} ${panel.x[1]}<br>${panel.y[0]} %{y:.5~g} ${panel.y[1]}<extra></extra>`,
    };
    if (marked(line)) {
      const size = line.style === "rings" ? 16 : line.style === "triangle_line" ? 10 : JOINED.has(line.style) ? 6 : few ? 8 : 3;
      trace.marker = { color: colour, size, symbol: SYMBOLS[line.style], line: { width: few ? 1.5 : 0, color: colour } };
    }
    if (!marked(line) || JOINED.has(line.style)) trace.line = { color: colour, width: WIDTHS[line.style], dash: DASHES[line.style] || "solid", simplify: false };
    if (line.style === "wide") trace.opacity = 0.7;  // what lies thin on top of it is seen
    if (line.style === "pale") trace.opacity = 0.6;
    if (line.style === "faint") trace.opacity = 0.3;
    if (line.up !== null && marked(line)) trace.error_y = { type: "data", symmetric: false, array: [...array(line.up)], arrayminus: [...array(line.down)], color: colour, thickness: 1.5, width: 4 };
    return trace;
  }

  // A line with an interval: the band first, under the line.
  function band(line, row, look) {
    const x = [...array(line.x)], y = array(line.y), up = array(line.up), down = array(line.down);
    const high = x.map((_, i) => y[i] + up[i]), low = x.map((_, i) => y[i] - down[i]);
    return {
      type: "scatter", x: [...x, ...x.slice().reverse()], y: [...high, ...low.reverse()], mode: "lines",
      line: { width: 0, color: look[line.colour] || line.colour }, fill: "toself", opacity: 0.25, hoverinfo: "skip", showlegend: false,
      xaxis: "x", yaxis: row ? `y${row + 1}` : "y", meta: line.setting, name: line.label,
    };
  }

  const traces = (line, panel, row, look, keyed) =>
    [...(line.up !== null && !marked(line) ? [band(line, row, look)] : []), trace(line, panel, row, look, keyed)];

  function axes(plot, look) {
    const n = plot.panels.length;
    const common = { gridcolor: look.grid, zerolinecolor: look.muted, linecolor: look.muted, automargin: true };
    const layout = { xaxis: { ...common, title: { text: label(plot.panels[n - 1].x) }, anchor: n > 1 ? `y${n}` : "y" } };
    const first = plot.panels[0];
    if (first.ticks.length) Object.assign(layout.xaxis, { tickvals: first.ticks, ...(first.labels ? { ticktext: first.labels } : {}), tickangle: 0, zeroline: false, ...(printing ? { tickfont: { size: 8 } } : {}) });
    if (first.xrange) layout.xaxis.range = first.xrange;
    plot.panels.forEach((panel, row) => {
      // The upper panel takes the larger part.
      const domain = n === 1 ? [0, 1] : row === 0 ? [0.42, 1] : [0, 0.34];
      layout[row ? `yaxis${row + 1}` : "yaxis"] = { ...common, title: { text: label(panel.y), standoff: 8 }, domain, type: panel.log ? "log" : "linear", exponentformat: "power", ...(panel.log ? { dtick: 1, tickfont: { size: printing ? 8 : 10 } } : {}) };
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
      for (const line of panel.lines) {
        if (!line.tag || off.has(String(line.setting))) continue;
        const x = array(line.x), y = array(line.y), end = x.indexOf(Math.max(...x));
        annotations.push({ x: x[end], y: y[end], yref, xanchor: "left", xshift: 6, text: line.tag, showarrow: false, font: { size: 12, color: look[line.colour] || line.colour } });
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
      panel.lines.filter((line) => !off.has(String(line.setting))).flatMap((line) => traces(line, panel, row, look, plot.keyed)));
    const shown = data.filter((trace) => trace.showlegend).length;
    const layout = {
      ...axes(plot, look), ...marks(plot, look),
      paper_bgcolor: look.paper, plot_bgcolor: look.paper,
      font: { color: look.ink, size: printing ? 10 : 12 },
      margin: { l: 60, r: 12, t: printing ? 24 : shown > 1 && shown <= 6 ? 50 : 30, b: printing ? 36 : 44 },
      showlegend: shown > 1,
      legend: shown > 6 && !printing ? { font: { size: 10 } } : { orientation: "h", y: 1.02, yanchor: "bottom", font: { size: printing ? 7 : 11 } },
      hovermode: "closest",
      uirevision: plot.name,  // a zoom survives switching
    };
    const [width, height] = div.closest(".first") ? [690, 380] : [340, 235];  // paper
    if (printing) Object.assign(layout, { width, height, showlegend: shown > 1 && shown <= 6 });
    drawn.add(place);
    return Plotly.react(div, data, layout, { responsive: true, displaylogo: false, displayModeBar: "hover", modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]], toImageButtonOptions: { format: "svg", filename: plot.name } });
  }

  const place_of = (place) => document.getElementById(`plot-${place}`);
  const away = (place) => place_of(place).closest("[hidden], details:not([open])");

  function drawAll() {
    plots.forEach((_, place) => { if (!drawn.has(place) && !away(place)) draw(place); });
  }

  // What is seen is drawn first, the rest while the page rests.
  const queue = plots.keys();
  const rest = window.requestIdleCallback || ((work) => setTimeout(work, 10));
  function step() {
    for (const place of queue) {
      if (drawn.has(place) || away(place)) continue;
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
    drawn.forEach((place) => { if (!away(place)) draw(place); });
  }

  function switched() {
    document.querySelectorAll(".log").forEach((log) => { log.hidden = off.has(log.dataset.setting); });
    plots.forEach((_, place) => {
      if (place_of(place).closest("[hidden]") && drawn.delete(place)) Plotly.purge(`plot-${place}`);
    });
    redraw();
    drawAll();
  }
  const boxes = [...document.querySelectorAll("nav input")];
  function set(box, on) {
    box.checked = on;
    const setting = box.dataset.setting;
    if (on) off.delete(setting); else off.add(setting);
  }
  boxes.forEach((box) => box.addEventListener("change", () => { set(box, box.checked); switched(); }));
  document.getElementById("all").addEventListener("click", () => { boxes.forEach((box) => set(box, true)); switched(); });
  document.getElementById("none").addEventListener("click", () => { boxes.forEach((box) => set(box, false)); switched(); });

  dark.addEventListener("change", redraw);
  const details = [...document.querySelectorAll("details")];
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = details.filter((fold) => !fold.open);
    opened.forEach((fold) => { fold.open = true; });
    printing = true; 
    redraw();
    drawAll();
  });
  addEventListener("afterprint", () => {
    opened.forEach((fold) => { fold.open = false; });
    printing = false;
    redraw();
  });
  const jump = document.getElementById("jump");
  jump.addEventListener("change", () => {
    const place = document.querySelector(`.log[data-setting="${CSS.escape(jump.value)}"]`);
    if (place && place.hidden) boxes.filter((box) => box.dataset.setting === place.dataset.setting).forEach((box) => { set(box, true); switched(); });
    if (place) enter(place);
    jump.value = "";
  });
  // What is about one log is folded: its plots are drawn when it is opened, or entered by a link.
  function enter(place) {
    if (place.tagName === "DETAILS") place.open = true;
    place.scrollIntoView();
  }
  function entered() {
    const place = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (place) enter(place);
  }
  details.forEach((fold) => fold.addEventListener("toggle", () => { if (fold.open) drawAll(); }));
  addEventListener("hashchange", entered);
  entered();
  window.damperfit = { plots, colours, drawAll };
})();
