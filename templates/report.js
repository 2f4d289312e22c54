"use strict";
// Marks in the contents where one is, hides tests without every word of a search, and copies tables.
// Without this script all is shown, and the browser itself opens what a link leads into.
(() => {
  const contents = document.querySelector(".contents > details > ol");
  const entries = Array.from(document.querySelectorAll(".contents a[href^='#']"))
    .map((link) => [link, document.getElementById(link.hash.slice(1))])
    .filter(([, target]) => target && target.localName === "section");

  let marked = null, waiting = false;
  function mark() {
    waiting = false;
    let found = null;
    for (const [link, target] of entries) {
      if (!target.hidden && target.getBoundingClientRect().top < innerHeight / 3) found = link;
    }
    if (found === marked) return;
    if (marked) marked.removeAttribute("aria-current");
    if (found) found.setAttribute("aria-current", "true");
    marked = found;
  }
  addEventListener("scroll", () => {
    if (!waiting) requestAnimationFrame(mark);
    waiting = true;
  }, { passive: true });
  mark();

  // What a link leads into is opened, in browsers that do not.
  function reveal() {
    const target = document.getElementById(location.hash.slice(1));
    let folded = false;
    for (let each = target; each; each = each.parentElement) {
      if (each.localName === "details" && !each.open) folded = each.open = true;
    }
    if (folded) target.scrollIntoView();
  }
  addEventListener("hashchange", reveal);
  reveal();

  const tests = entries.filter(([, target]) => target.classList.contains("test"));
  if (!contents || !tests.length) return;
  const label = document.createElement("label"), box = document.createElement("input");
  const count = document.createElement("output");
  label.className = "search";
  label.append("Filter tests and figures", box, count);
  box.type = "search";
  contents.before(label);
  const titles = ".number, strong, h2, h3";
  box.addEventListener("input", () => {
    const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
    const has = (text) => words.every((word) => text.toLowerCase().includes(word));
    let shown = 0;
    for (const [link, target] of tests) {
      const told = Array.from(target.querySelectorAll(titles), (each) => each.textContent).join(" ");
      const hidden = !has(`${told} ${target.querySelector("h2").textContent}`);
      target.hidden = link.parentElement.hidden = hidden;
      shown += hidden ? 0 : 1;
    }
    count.textContent = words.length ? `${shown} of ${tests.length} tests` : "";
    mark();
  });
})();

(() => {
  const escaped = { "&": "\\&", "%": "\\%", "#": "\\#", "_": "\\_", "$": "\\$", "{": "\\{", "}": "\\}",
    "\\": "\\textbackslash{}", "^": "\\^{}", "~": "\\~{}", "±": "$\\pm$", "−": "$-$", "·": "$\\cdot$",
    "≤": "$\\le$", "≥": "$\\ge$", "≈": "$\\approx$", "°": "$^\\circ$", "²": "$^2$", "³": "$^3$", "µ": "$\\mu$",
    "σ": "$\\sigma$", "δ": "$\\delta$", "✓": "$\\checkmark$", "\u00a0": "~", "†": "\\dag{}",
    "\ue000": "\\", "\ue001": "{", "\ue002": "}", "\ue003": "^" };
  const latex = (text) => Array.from(text, (each) => escaped[each] ?? each).join("");
  // Numbers and units are set by siunitx; private letters stand for those of its commands.
  const ONE = "[-−+]?\\d+(?:\\.\\d+)?", BOTH = `${ONE}[ \u00a0]±[ \u00a0]${ONE}`, TEN = " × 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)";
  const NUMBER = new RegExp(`\\((${BOTH})\\)${TEN}|(?<![\\w.])(${BOTH}|${ONE})(?:${TEN})?(?![\\w.])`, "g");
  const UNIT = /\((1?(?:[·/]?(?:[A-Za-zµ]{1,4}|[°%Ω])[²³]?)+)\)$/;
  const command = (name, text) => `\ue000${name}\ue001${text}\ue002`;
  const number = (text) => latex(text.replace(NUMBER, (_, all, ofAll, one, ofOne) => {
    const power = Array.from(ofAll ?? ofOne ?? "", (each) => (each === "⁻" ? "-" : "⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(each))).join("");
    const value = (all ?? one).replaceAll("−", "-").replace("±", "\ue000pm").replaceAll("\u00a0", " ");
    return command("num", power ? `${value} e${power}` : value);
  }));
  const unit = { "²": "\ue0032", "³": "\ue0033", "·": ".", "%": "\ue000percent ", "°": "\ue000degree ", "µ": "\ue000micro ", "Ω": "\ue000ohm " };
  const head = (text) => latex(text.replace(UNIT, (_, told) =>
    `(${command("unit", Array.from(told, (each) => unit[each] ?? each).join(""))})`));
  const line = (cells) => `${cells.join(" & ")} \\\\`;
  const forms = {
    TSV: (rows) => rows.map((cells) => cells.join("\t")).join("\n"),
    Markdown: ([head, ...rows], right) => [
      head, right.map((each) => (each ? "---:" : "---")), ...rows,
    ].map((cells) => `| ${cells.map((each) => each.replaceAll("|", "\\|")).join(" | ")} |`).join("\n"),
    LaTeX: ([first, ...rows], right) => [
      `\\sisetup{separate-uncertainty,retain-explicit-plus}\\begin{tabular}{${right.map((each) => (each ? "r" : "l")).join("")}}`, "\\toprule", line(first.map(head)),
      "\\midrule", ...rows.map((cells) => line(cells.map((each, n) => (right[n] ? number : latex)(each)))), "\\bottomrule", "\\end{tabular}",
    ].join("\n"),
  };

  async function copy(table, form, bar) {
    const told = bar.querySelector("output") ?? bar.appendChild(document.createElement("output"));
    const rows = Array.from(table.rows, (row) =>
      Array.from(row.cells, (cell) => cell.textContent.replace(/[^\S\u00a0]+/g, " ").trim()));
    const further = document.querySelector(`#${table.closest(".table").id}-rows > pre`);
    for (const line of further?.textContent.split("\n").slice(1) ?? []) {
      rows.push(line.split("\t").map((each) => each.trim()));
    }
    const right = Array.from(table.rows[0].cells, (cell) => cell.classList.contains("n"));
    try {
      await navigator.clipboard.writeText(forms[form](rows, right));
      told.textContent = `copied as ${form}`;
    } catch {
      told.textContent = "the browser does not let a page copy; the CSV file has the numbers";
    }
  }
  for (const box of document.querySelectorAll(".table")) {
    const table = box.querySelector("table"), bar = document.createElement("p");
    bar.className = "copy";
    bar.append("Copy as ");
    for (const form of Object.keys(forms)) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = form;
      button.setAttribute("aria-label", `Copy ${box.querySelector(".number").textContent} as ${form}`);
      button.addEventListener("click", () => copy(table, form, bar));
      bar.append(button);
    }
    box.append(bar);
  }
})();
