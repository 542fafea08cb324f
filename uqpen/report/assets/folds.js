(() => {
  // A link to a folded part opens it, and all that it lies in.
  function unfold(target) {
    if (target === null) return;
    const own = target.querySelector(":scope > details.part");
    for (let at = own || target.closest("details"); at; at = at.parentElement.closest("details")) {
      at.open = true;
    }
  }

  const named = (hash) => document.getElementById(hash.slice(1));
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#']");
    if (link) unfold(named(link.getAttribute("href")));
  });
  window.addEventListener("hashchange", () => unfold(named(location.hash)));
  const first = named(location.hash);
  unfold(first);
  if (first) first.scrollIntoView();
})();
