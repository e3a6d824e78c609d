// Tables whose rows do not all stand on the page: a part of them at a time, and those that have some words.
(() => {
  "use strict";
  for (const place of document.querySelectorAll("div.paged")) {
    const { step, rows } = JSON.parse(place.querySelector("script").textContent);
    const body = place.querySelector("tbody");
    const said = place.querySelector("output");
    const wanted = place.querySelector("input");
    const [back, on] = place.querySelectorAll("button");
    let [found, first] = [rows, 0];
    const line = ([link, ...cells]) => {
      const row = document.createElement("tr");
      cells.forEach((cell, k) => {
        const at = row.appendChild(document.createElement(k ? "td" : "th"));
        if (!k) at.scope = "row";
        const into = k || !link ? at : at.appendChild(document.createElement("a"));
        if (into !== at) into.href = link;
        into.textContent = cell;
      });
      return row;
    };
    const show = () => {
      const end = Math.min(first + step, found.length);
      body.replaceChildren(...found.slice(first, end).map(line));
      said.textContent = `${found.length ? first + 1 : 0} to ${end} of ${found.length}`;
      back.disabled = first === 0;
      on.disabled = end >= found.length;
    };
    back.addEventListener("click", () => { first = Math.max(first - step, 0); show(); });
    on.addEventListener("click", () => { first += step; show(); });
    wanted.addEventListener("input", () => {
      const words = wanted.value.toLowerCase().split(/\s+/).filter(Boolean);
      const has = (row) => {
        const text = row.slice(1).join(" ").toLowerCase();
        return words.every((word) => text.includes(word));
      };
      [found, first] = [words.length ? rows.filter(has) : rows, 0];
      show();
    });
    place.querySelector(".turn").hidden = false;
    show();
  }
})();
