"use strict";
// Marks in the contents where one is, and hides tests without every word of a search. Without this
// script all is shown, and the browser itself opens what a link leads into.
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
