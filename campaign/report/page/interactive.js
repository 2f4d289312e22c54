// Turns the figures whose points the page carries into ones that zoom, and back. One switch for the
// page; a figure is made when it comes into sight. Nothing is asked of any network.
(() => {
  "use strict";
  const HELP = "Drag to zoom, double-click for all. Keys: arrows move the cursor, + and − zoom at it, " +
    "Shift with an arrow moves the stretch, 0 shows all.";
  const STEP = 1 / 50, NARROWER = 0.5, LEAST = 1e-6;
  let figures = null; // anchor to its points, read when somebody asks for them
  let seen = null;
  const open = new Map(); // figure element to its panels

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const floats = (text) => new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

  // The fewest digits that tell a float32 from its neighbours.
  const digits = (value) => {
    for (let count = 1; count < 9; count++) {
      const text = value.toPrecision(count);
      if (Math.fround(Number(text)) === value) return Number(text).toString();
    }
    return value.toPrecision(9);
  };
  const told = (value) => (value === null || value === undefined ? "–" : digits(value)).replace("-", "−");

  // Columns of one curve for a joined axis: NaN is a gap.
  const column = (values) => Array.from(values, (value) => (Number.isNaN(value) ? null : value));

  function table(panel, arrays) {
    const tables = [], series = [], bands = [], bars = [];
    for (const curve of panel.curves) {
      const [stroke, points] = [colour(curve.colour), curve.style === "points"];
      const columns = [column(arrays[curve.x])];
      const add = (values, more) => {
        columns.push(column(values));
        series.push({ stroke, width: 1.4, value: (u, value) => told(value), points: { show: false }, ...more });
      };
      const edges = "low" in curve && !points;
      if (edges) {
        const edge = { width: 0, label: "", class: "zoom-edge" };
        add(arrays[curve.high], edge);
        add(arrays[curve.low], edge);
        bands.push({ series: [series.length - 1, series.length], fill: `${stroke}2e` });
      }
      if (curve.style !== "band") {
        const dash = curve.dash.map((length) => 1.4 * length);
        const marks = { show: true, size: points ? 5 : 6, fill: stroke, stroke, width: 0 };
        add(arrays[curve.y], {
          label: curve.label || panel.title || panel.y.label,
          ...(dash.length && !points ? { dash } : {}),
          ...(points ? { paths: () => null } : {}),
          ...(curve.style === "line" || curve.style === "thin" ? {} : { points: marks }),
        });
      }
      if ("low" in curve && points) bars.push([arrays[curve.x], arrays[curve.low], arrays[curve.high], stroke]);
      tables.push(columns);
    }
    return { data: uPlot.join(tables), series, bands, bars };
  }

  // Lines across the panel with their names, and bars of intervals.
  function besides(u, panel, bars) {
    const { ctx, bbox } = u, ratio = devicePixelRatio;
    const line = (stroke, dash, ...points) => {
      ctx.strokeStyle = stroke;
      ctx.lineWidth = ratio;
      ctx.setLineDash(dash.map((length) => length * ratio));
      ctx.beginPath();
      points.forEach(([x, y], n) => (n ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
      ctx.stroke();
    };
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const [x, low, high, stroke] of bars) {
      x.forEach((at, n) => {
        const across = u.valToPos(at, "x", true);
        line(stroke, [], [across, u.valToPos(low[n], "y", true)], [across, u.valToPos(high[n], "y", true)]);
      });
    }
    ctx.fillStyle = colour("muted");
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.font = `${11 * ratio}px ${getComputedStyle(document.body).fontFamily}`;
    for (const mark of panel.marks) {
      const x = "x" in mark ? u.valToPos(mark.x, "x", true) : null;
      const y = "y" in mark ? u.valToPos(mark.y, "y", true) : null;
      if ("until" in mark) {
        const until = u.valToPos(mark.until, x === null ? "y" : "x", true);
        ctx.globalAlpha = 0.12;
        if (x === null) ctx.fillRect(bbox.left, y, bbox.width, until - y);
        else ctx.fillRect(x, bbox.top, until - x, bbox.height);
        ctx.globalAlpha = 1;
      } else {
        if (x !== null) line(colour("muted"), [3, 2], [x, bbox.top], [x, bbox.top + bbox.height]);
        if (y !== null) line(colour("muted"), [3, 2], [bbox.left, y], [bbox.left + bbox.width, y]);
      }
      ctx.fillText(mark.label, (x ?? bbox.left) + 4 * ratio, (y ?? bbox.top + 14 * ratio) - 3 * ratio);
    }
    ctx.restore();
  }

  function axis(side, told) {
    const font = `11px ${getComputedStyle(document.body).fontFamily}`;
    const lines = { stroke: colour("hairline"), width: 1 };
    return {
      side, font, labelFont: font, label: told.label, labelSize: 20, stroke: colour("ink"),
      grid: lines, ticks: { ...lines, size: 4 }, size: side === 3 ? 56 : 28,
      values: (u, ticks) => ticks.map((tick) => (tick === null ? "" : String(+tick.toPrecision(6)).replace("-", "−"))),
    };
  }

  function makePanel(host, panel, arrays, width, height) {
    const place = host.appendChild(document.createElement("div"));
    place.className = "zoom-panel";
    if (panel.title) place.appendChild(document.createElement("strong")).textContent = panel.title;
    const { data, series, bands, bars } = table(panel, arrays);
    const scale = (told) => ({ time: false, distr: told.log ? 3 : 1 });
    const home = panel.x.limits ?? [data[0][0], data[0][data[0].length - 1]];
    const ends = { min: home[0], max: home[1] };
    const all = (u) => u.setScale("x", { ...ends });
    const u = new uPlot({
      width, height, bands,
      scales: { x: scale(panel.x), y: { ...scale(panel.y), ...(panel.y.limits ? { range: panel.y.limits } : {}) } },
      axes: [axis(2, panel.x), axis(3, panel.y)],
      series: [{ label: panel.x.label, value: (u, value) => told(value) }, ...series],
      cursor: { bind: { dblclick: (u) => () => all(u) } },
      hooks: { draw: [(u) => besides(u, panel, bars)] },
    }, data, place);
    all(u);
    for (const edge of place.querySelectorAll(".u-legend .zoom-edge")) edge.remove();
    return { u, home: ends };
  }

  function build(figure) {
    const { across, panels, arrays: texts } = figures[figure.id];
    const still = [...figure.children].find((child) => child.querySelector("svg[role=img]") || child.matches("svg"));
    const box = still.getBoundingClientRect();
    const host = document.createElement("div");
    host.className = "zoom";
    host.tabIndex = 0;
    host.setAttribute("role", "group");
    const name = figure.querySelector("figcaption strong")?.textContent ?? "Figure";
    host.setAttribute("aria-label", `${name} Interactive. ${HELP}`);
    still.classList.add("zoom-static");
    still.before(host);
    const columns = box.width < 600 ? 1 : clamp(across, 1, panels.length);
    host.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
    figure.classList.add("zoomed");
    const wide = (host.clientWidth || box.width) / columns - (columns > 1 ? 12 : 0);
    const high = clamp(box.height / Math.ceil(panels.length / columns) - 70, 180, 420);
    const arrays = texts.map(floats);
    const made = panels.map((panel) => makePanel(host, panel, arrays, Math.floor(wide), Math.floor(high)));
    const help = host.appendChild(document.createElement("p"));
    help.className = "zoom-help";
    help.textContent = HELP;
    host.addEventListener("keydown", (event) => keyed(event, made));
    host.plots = made.map(({ u }) => u);
    open.set(figure, { host, still });
  }

  function keyed(event, made) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    const zoom = { "+": NARROWER, "=": NARROWER, "-": 1 / NARROWER, "−": 1 / NARROWER }[event.key];
    if (way === undefined && zoom === undefined && event.key !== "0" && event.key !== "Escape") return;
    event.preventDefault();
    for (const { u, home } of made) {
      const wide = u.over.clientWidth;
      const at = u.cursor.left >= 0 ? u.cursor.left : wide / 2;
      if (way && !event.shiftKey) {
        u.setCursor({ left: clamp(at + way * STEP * wide, 0, wide - 1), top: u.over.clientHeight / 2 });
      } else if (way) {
        stretch(u, home, way * 0.1 * wide, wide + way * 0.1 * wide);
      } else if (zoom) {
        stretch(u, home, at - at * zoom, at + (wide - at) * zoom);
      } else {
        u.setScale("x", { ...home });
      }
    }
  }

  // Show what lies between two places of the panel, in CSS pixels, within all there is.
  function stretch(u, home, left, right) {
    const ends = [left, right].map((place) => clamp(u.posToVal(place, "x"), home.min, home.max));
    if (ends[1] - ends[0] > LEAST * (home.max - home.min)) u.setScale("x", { min: ends[0], max: ends[1] });
  }

  function close(figure) {
    const { host, still } = open.get(figure);
    host.plots.forEach((u) => u.destroy());
    host.remove();
    still.classList.remove("zoom-static");
    figure.classList.remove("zoomed");
    open.delete(figure);
  }

  function turn(on) {
    button.setAttribute("aria-pressed", String(on));
    if (!on) {
      seen?.disconnect();
      seen = null;
      [...open.keys()].forEach(close);
      return;
    }
    figures ??= JSON.parse(document.getElementById("interactive-data").content.textContent);
    seen = new IntersectionObserver((entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting || open.has(target)) continue;
        seen.unobserve(target);
        build(target);
      }
    }, { rootMargin: "50%" });
    Object.keys(figures).map((id) => document.getElementById(id)).filter(Boolean)
      .forEach((figure) => seen.observe(figure));
  }

  const on = () => button.getAttribute("aria-pressed") === "true";
  const anew = () => { if (on()) { turn(false); turn(true); } };
  const button = document.createElement("button");
  button.type = "button";
  button.className = "zoom-switch";
  button.textContent = "Zoom and read values";
  button.setAttribute("aria-pressed", "false");
  button.addEventListener("click", () => turn(!on()));
  document.querySelector("main").prepend(button);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", anew);
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; anew(); } });
})();
