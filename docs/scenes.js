"use strict";
// Shows the scene of a link below it while it is in view.  Browsers draw about sixteen
// scenes at once, so those out of view are removed.
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
