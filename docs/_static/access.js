// Headings of the sidebar have a level, its two parts have names that screen readers tell apart, and what
// scrolls sideways does so by the keyboard too.
document.addEventListener("DOMContentLoaded", () => {
  for (const caption of document.querySelectorAll(".caption[role=heading]")) caption.ariaLevel = "2";
  const names = { ".sidebar-drawer": "All pages", ".toc-drawer": "This page" };
  for (const [drawer, name] of Object.entries(names)) {
    for (const part of document.querySelectorAll(drawer)) part.ariaLabel = name;
  }
});
window.addEventListener("load", () => {
  for (const part of document.querySelectorAll("article *")) {
    if (part.scrollWidth > part.clientWidth && /auto|scroll/.test(getComputedStyle(part).overflowX)) part.tabIndex = 0;
  }
});
