// Sorts a table by a column when its head is clicked; a second click reverses the order.
document.addEventListener("click", ({ target }) => {
  const head = target.closest("article th");
  if (!head) return;
  const body = head.closest("table").tBodies[0];
  const number = (row) => parseFloat(row.cells[head.cellIndex].textContent);
  const text = (row) => row.cells[head.cellIndex].textContent;
  const up = head.dataset.order !== "up";
  for (const other of head.parentElement.cells) delete other.dataset.order;
  head.dataset.order = up ? "up" : "down";
  const value = (row) => (Number.isNaN(number(row)) ? -Infinity : number(row));
  const isText = [...body.rows].every((row) => Number.isNaN(number(row)));
  const compare = (a, b) => (isText ? text(a).localeCompare(text(b)) : value(a) - value(b));
  body.append(...[...body.rows].sort((a, b) => (up ? compare(a, b) : compare(b, a))));
});
