"use strict";
// Show the scene below its link while the link is in view.  Browsers can display only
// about sixteen scenes simultaneously, so scenes that are out of view are removed.
const views = new IntersectionObserver(entries => {
  for (const { target, isIntersecting } of entries) {
    const [shown] = target.children;
    if (isIntersecting && !shown) {
      target.append(Object.assign(document.createElement("iframe"),
        { src: target.dataset.scene, title: target.dataset.title }));
    } else if (!isIntersecting && shown) shown.remove();
  }
}, { rootMargin: "300px" });
for (const link of document.querySelectorAll("a.scene")) {
  const room = document.createElement("div");
  room.className = "scene-room";
  Object.assign(room.dataset, { scene: link.href, title: link.textContent });
  link.textContent += ": open the scene in the whole window";
  link.parentNode.after(room);
  views.observe(room);
}
