
"use strict";
// Hides the runs that do not have every word of the search; without this script all are shown.
const box = document.getElementById("words");
const count = document.getElementById("count");
const runs = Array.from(document.querySelectorAll("#runs > li"));
const texts = runs.map((run) => run.textContent.toLowerCase());
function search() {
  const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
  let shown = 0;
  runs.forEach((run, place) => {
    run.hidden = !words.every((word) => texts[place].includes(word));
    shown += run.hidden ? 0 : 1;
  });
  count.textContent = words.length ? `${shown} of ${runs.length}` : "";
}
document.getElementById("search").hidden = false;
box.addEventListener("input", search);
search();
