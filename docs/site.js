// Tables that are wider than the page scroll by keyboard, too; the search dialog and each list of contents have a name.
window.addEventListener("load", () => {
  document.querySelector(".md-search")?.setAttribute("aria-label", "Search");
  for (const list of document.querySelectorAll("nav.md-nav--secondary nav.md-nav[aria-label]")) {
    list.ariaLabel = `${list.parentElement.closest("nav").ariaLabel}: ${list.ariaLabel}`;
  }
  for (const list of document.querySelectorAll("nav.md-nav[aria-labelledby]")) {
    const label = document.getElementById(list.getAttribute("aria-labelledby"));
    if (!label?.innerText.trim()) list.ariaLabel = list.parentElement.querySelector("a").innerText.trim();
    if (list.ariaLabel) list.removeAttribute("aria-labelledby");
  }
  for (const copy of document.querySelectorAll("nav.md-code__nav")) copy.role = "none";
  const mark = () => {
    for (const box of document.querySelectorAll(".md-typeset__scrollwrap")) {
      if (box.scrollWidth > box.clientWidth) Object.assign(box, { tabIndex: 0, role: "region", ariaLabel: "Table" });
      else box.removeAttribute("tabindex");
    }
  };
  mark();
  window.addEventListener("resize", mark);
});
