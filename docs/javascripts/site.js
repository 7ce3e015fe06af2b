// Names and keyboard access that Material for MkDocs leaves out. It adds code buttons and tables' frames while a page loads.
function complete() {
  document.querySelector(".md-search")?.setAttribute("aria-label", "Search");
  document.querySelectorAll(".md-code__nav").forEach((nav, i) => nav.setAttribute("aria-label", `Code ${i + 1}`));
  for (const nav of document.querySelectorAll("nav[aria-labelledby]")) {
    if (!document.getElementById(nav.getAttribute("aria-labelledby"))?.textContent.trim()) {
      nav.setAttribute("aria-label", nav.querySelector(".md-nav__title").textContent.trim());
      nav.removeAttribute("aria-labelledby");
    }
  }
  for (const part of document.querySelectorAll(".md-nav--secondary .md-nav")) {
    part.removeAttribute("aria-label"); // a part of the table of contents is no landmark of its own
    part.setAttribute("role", "none");
  }
  for (const frame of document.querySelectorAll(".md-typeset__scrollwrap")) {
    if (frame.scrollWidth > frame.clientWidth) {
      frame.tabIndex = 0;
      frame.setAttribute("role", "group");
      frame.setAttribute("aria-label", "Table");
    }
  }
}

new MutationObserver(complete).observe(document.body, { childList: true, subtree: true });
addEventListener("resize", complete);
complete();
