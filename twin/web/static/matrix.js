// Tables of reports that sort and filter.
for (const box of document.querySelectorAll("section:has(.matrix)")) {
  const body = box.querySelector(".matrix tbody"), heads = [...box.querySelectorAll(".matrix th")];
  const [word, only] = box.querySelectorAll("input"), rows = [...body.rows], value = (row, at) => row.cells[at].dataset.value ?? row.cells[at].textContent;
  const words = row => [...row.cells].filter(cell => !cell.classList.contains("number")).map(cell => cell.textContent).join(" ").toLowerCase();
  const filter = () => {
    for (const row of rows) row.hidden = (only.checked && !row.classList.contains("bad")) || !words(row).includes(word.value.toLowerCase());
    box.querySelector("[aria-live]").textContent = rows.filter(row => !row.hidden).length + " of " + rows.length;
  };
  heads.forEach((head, at) => head.querySelector("button").addEventListener("click", () => {
    const down = head.ariaSort === "ascending" ? -1 : 1;
    heads.forEach(other => other.ariaSort = other === head ? (down === 1 ? "ascending" : "descending") : "none");
    const order = (a, b) => isNaN(a) || isNaN(b) ? a.localeCompare(b) : a - b;
    // rows without a value stay last in both orders
    rows.sort((a, b) => (value(a, at) === "") - (value(b, at) === "") || down * order(value(a, at), value(b, at)));
    body.append(...rows);
  }));
  word.addEventListener("input", filter);
  only.addEventListener("change", filter);
  filter();
}
