// A table of any number of rows, of which only those that are seen are in the page.

/**
 * @typedef {{title: string, width: string, right?: boolean}} TableColumn
 * @typedef {{count: () => number, cells: (index: number) => string[], kind: (index: number) => string,
 *   pick: (index: number) => void}} TableSource
 */

const ROW = 24;
/** Browsers know no element higher than some 30 million pixels. */
const TALLEST = 8_000_000;

/** A table in an element; rows are chosen by a click or by the keys. */
export class Table {
  /**
   * @param {HTMLElement} host
   * @param {string} name
   * @param {TableColumn[]} columns
   * @param {TableSource} source
   */
  constructor(host, name, columns, source) {
    this.columns = columns;
    this.source = source;
    this.selected = -1;
    this.name = name;
    host.classList.add("table");
    this.grid = element("div", "grid", host);
    this.grid.setAttribute("role", "grid");
    this.grid.setAttribute("aria-label", name);
    this.grid.tabIndex = 0;
    const head = element("div", "row head", this.grid);
    head.setAttribute("role", "row");
    head.setAttribute("aria-rowindex", "1");
    for (const column of columns) {
      const cell = element("span", column.right ? "right" : "", head);
      cell.setAttribute("role", "columnheader");
      cell.textContent = column.title;
    }
    this.body = element("div", "body", this.grid);
    this.body.setAttribute("role", "rowgroup");
    this.empty = element("p", "empty", host);
    this.grid.style.setProperty("--columns", columns.map((each) => each.width).join(" "));
    this.grid.addEventListener("scroll", () => this.draw());
    this.grid.addEventListener("keydown", (event) => this.#key(event));
    this.body.addEventListener("click", (event) => {
      const row = /** @type {HTMLElement} */ (event.target).closest("[data-index]");
      if (row instanceof HTMLElement) this.select(Number(row.dataset.index));
    });
  }

  get #page() {
    return Math.max(1, Math.floor((this.grid.clientHeight - ROW) / ROW));
  }

  /** Whether its end is seen. */
  get atEnd() {
    return this.grid.scrollTop + this.grid.clientHeight >= this.grid.scrollHeight - 2 * ROW;
  }

  /** Pixels the rows would take, and those they take. */
  #heights() {
    const wanted = this.source.count() * ROW;
    return { wanted, taken: Math.min(wanted, TALLEST) };
  }

  /** Number of the first row that is seen. */
  #first() {
    const { wanted, taken } = this.#heights();
    const seen = this.grid.clientHeight - ROW;
    const scrolled = this.grid.scrollTop;
    const part = wanted > taken ? (scrolled * (wanted - seen)) / Math.max(1, taken - seen) : scrolled;
    return Math.max(0, Math.floor(part / ROW));
  }

  /** Draw the rows that are seen. */
  draw() {
    const count = this.source.count();
    const { taken } = this.#heights();
    this.body.style.height = `${taken}px`;
    this.grid.setAttribute("aria-rowcount", String(count + 1));
    const first = Math.min(this.#first(), Math.max(0, count - this.#page));
    const rows = Math.min(count - first, this.#page + 2);
    const top = Math.min(this.grid.scrollTop - (this.grid.scrollTop % ROW), taken - rows * ROW);
    while (this.body.children.length > rows) this.body.lastElementChild?.remove();
    while (this.body.children.length < rows) {
      const row = element("div", "row", this.body);
      row.setAttribute("role", "row");
      for (const column of this.columns) {
        const cell = element("span", column.right ? "right" : "", row);
        cell.setAttribute("role", "gridcell");
      }
    }
    for (let number = 0; number < rows; number++) {
      const index = first + number;
      const row = /** @type {HTMLElement} */ (this.body.children[number]);
      row.style.transform = `translateY(${Math.max(0, top)}px)`;
      row.id = `${this.name}-${index}`;
      row.dataset.index = String(index);
      row.dataset.kind = this.source.kind(index);
      row.setAttribute("aria-rowindex", String(index + 2));
      row.setAttribute("aria-selected", String(index === this.selected));
      for (const [place, text] of this.source.cells(index).entries()) {
        const cell = /** @type {HTMLElement} */ (row.children[place]);
        if (cell.textContent !== text) cell.textContent = text;
        cell.title = text;
      }
    }
    const current = document.getElementById(`${this.name}-${this.selected}`);
    if (current) this.grid.setAttribute("aria-activedescendant", current.id);
    else this.grid.removeAttribute("aria-activedescendant");
  }

  /**
   * Choose a row and go where it says.
   * @param {number} index
   */
  select(index) {
    const count = this.source.count();
    if (!count) return;
    this.selected = Math.max(0, Math.min(count - 1, index));
    this.see(this.selected);
    this.source.pick(this.selected);
    this.draw();
  }

  /**
   * Scroll so that a row is seen.
   * @param {number} index
   */
  see(index) {
    const first = this.#first();
    const page = this.#page;
    if (index >= first && index < first + page) return;
    const { wanted, taken } = this.#heights();
    this.body.style.height = `${taken}px`;
    const seen = this.grid.clientHeight - ROW;
    const place = Math.max(0, (index - Math.floor(page / 3)) * ROW);
    this.grid.scrollTop =
      wanted > taken ? (place * (taken - seen)) / (wanted - seen) : place;
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    /** @type {Record<string, number>} */
    const moves = {
      ArrowDown: this.selected + 1,
      ArrowUp: this.selected - 1,
      PageDown: this.selected + this.#page,
      PageUp: this.selected - this.#page,
      Home: 0,
      End: this.source.count() - 1,
      Enter: this.selected,
    };
    if (!(event.key in moves)) return;
    event.preventDefault();
    event.stopPropagation();
    this.select(moves[event.key]);
  }
}

/**
 * Make an element at the end of another.
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {string} names classes
 * @param {Element} parent
 * @returns {HTMLElementTagNameMap[T]}
 */
export function element(tag, names, parent) {
  const made = document.createElement(tag);
  if (names) made.className = names;
  parent.append(made);
  return made;
}

/**
 * Find an element of the page by its id.
 * @template {HTMLElement} T
 * @param {string} id
 * @param {new () => T} type
 * @returns {T}
 */
export function byId(id, type) {
  const found = document.getElementById(id);
  if (!(found instanceof type)) throw new Error(`the page has no ${type.name} "${id}"`);
  return found;
}
