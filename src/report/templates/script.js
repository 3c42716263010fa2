"use strict";
// A click, Enter or a blank on a column's head sorts the rows by it, a second one the other way round.
for (const table of document.querySelectorAll("table")) {
  const heads = [...table.tHead.rows[0].cells];
  const sort = (head, at) => {
    const down = head.ariaSort === "ascending" ? -1 : 1;
    heads.forEach((other) => { other.ariaSort = null; });
    head.ariaSort = down > 0 ? "ascending" : "descending";
    const text = (row) => row.cells[at].textContent.trim();
    const number = (row) => {
      const words = text(row).replace(/^[≤>±]\s*/, "").replace(/,/g, "");
      if (/^[+-]?∞/.test(words)) { return words.startsWith("-") ? -Infinity : Infinity; }
      return /^[+-]?\d*\.?\d+(e[+-]?\d+)?(?=$|[\sx%…[])/.test(words) ? Number.parseFloat(words) : NaN;
    };
    const order = (a, b) => {
      const [x, y] = [number(a), number(b)];
      if (Number.isNaN(x) && Number.isNaN(y)) { return down * text(a).localeCompare(text(b)); }
      return Number.isNaN(x) ? 1 : Number.isNaN(y) ? -1 : x === y ? 0 : down * (x > y ? 1 : -1);
    };
    table.tBodies[0].append(...[...table.tBodies[0].rows].sort(order));
  };
  heads.forEach((head, at) => {
    head.tabIndex = 0;
    head.addEventListener("click", () => sort(head, at));
    head.addEventListener("keydown", (event) => {
      if (event.key === "Enter" || event.key === " ") { event.preventDefault(); sort(head, at); }
    });
  });
}
// The value of a mark beside the pointer, at once.
const tip = document.getElementById("tip");
document.addEventListener("mousemove", (event) => {
  const mark = event.target.closest("figure g");
  const title = mark && [...mark.children].find((child) => child.tagName === "title");
  tip.hidden = !title;
  if (title) {
    tip.textContent = title.textContent;
    tip.style.left = Math.min(event.pageX + 12, document.documentElement.clientWidth - 270) + "px";
    tip.style.top = event.pageY + 14 + "px";
  }
});
// A link into a folded part opens it.
const open = () => document.getElementById(location.hash.slice(1))?.querySelector("details")?.setAttribute("open", "");
addEventListener("hashchange", open);
open();
// A part with figures prints, and a folded section with facts: hashes, program, command.
addEventListener("beforeprint", () => {
  document.querySelectorAll("details.part:has(figure), section > details:has(> dl)").forEach((part) => { part.open = true; });
});
