// A click, or Enter, on a picture shows it as large as the window; another, or Escape, closes it.
document.addEventListener("DOMContentLoaded", () => {
  const dialog = document.createElement("dialog");
  const large = new Image();  // is on the page only while it shows something
  dialog.className = "zoom";
  dialog.addEventListener("click", () => dialog.close());
  dialog.addEventListener("close", () => dialog.replaceChildren());
  document.body.append(dialog);
  for (const picture of document.querySelectorAll("article img")) {
    if (picture.closest("a")) continue;
    picture.tabIndex = 0;
    picture.setAttribute("role", "button");
    const show = () => {
      large.src = picture.src;
      large.alt = picture.alt;
      dialog.replaceChildren(large);
      dialog.showModal();
    };
    picture.addEventListener("click", show);
    picture.addEventListener("keydown", (event) => event.key === "Enter" && show());
  }
});
