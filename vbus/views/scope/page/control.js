// Control: a board that runs is paused, stepped, broken, and used by hand, where its server lets pages.

import { byId, element } from "./table.js";

/**
 * @typedef {{name: string, addresses: number}} HandChip
 * @typedef {{name: string, title: string, target: string, parameters: string[]}} HandFault
 * @typedef {{chips: HandChip[], pins: string[], edges: string[], faults: HandFault[]}} Manual
 * @typedef {{state: string, text: string, now_ps: string, rate: number | string | null}} Controlled
 * @typedef {{answer: string, error?: boolean, control?: Controlled, link?: string}} Answer
 */

/** What is asked for with each kind of step: the key of the order, a label, what is written there. */
/** @type {Record<string, {key: string, label: string, value: string}>} */
const STEPS = {
  cycle: { key: "count", label: "cycles", value: "1" },
  sample: { key: "chip", label: "of chip", value: "" },
  edge: { key: "pin", label: "of pin", value: "" },
  time: { key: "for", label: "for", value: "1 ms" },
  condition: { key: "until", label: "until", value: "" },
};

/** @param {string} id */
const input = (id) => byId(id, HTMLInputElement);
/** @param {string} id */
const select = (id) => byId(id, HTMLSelectElement);

/**
 * Put choices into a list.
 * @param {HTMLElement} list
 * @param {string[]} choices
 */
function offer(list, choices) {
  list.replaceChildren();
  for (const choice of choices) {
    const option = element("option", "", list);
    option.value = choice;
    option.textContent = choice;
  }
}

/**
 * Return a number as people write it: 12, 0x1F or 1FH.
 * @param {string} text
 */
function numberOf(text) {
  const written = text.trim();
  return /^[0-9a-f]+h$/i.test(written) ? Number.parseInt(written, 16) : Number(written || NaN);
}

/** The bar with which a board is controlled. */
export class Control {
  /** @param {(order: Record<string, unknown>) => void} send */
  constructor(send) {
    this.send = send;
    this.paused = false;
    /** Whether this page may do anything. */
    this.there = false;
    /** @type {Manual} */
    this.manual = { chips: [], pins: [], edges: [], faults: [] };
    this.#on("pause", () => send({ do: "pause" }));
    this.#on("go", () => send({ do: "go" }));
    this.#on("step", () => this.step());
    this.#on("read", () => this.#cycle(false));
    this.#on("write", () => this.#cycle(true));
    this.#on("drive", () => send({ do: "pin", pin: select("pin").value, level: select("level").value }));
    this.#on("fault-arm", () => this.#arm());
    this.#on("fault-clear", () => send({ do: "fault.clear", which: "all" }));
    this.#on("journal-save", () => send({ do: "journal.save" }));
    this.#on("rewind", () => send({ do: "rewind", to: input("rewind-to").value.trim() }));
    this.#on("back", () => send({ do: "back", to: input("rewind-to").value.trim() }));
    select("step-by").addEventListener("change", () => this.#kind());
    select("fault").addEventListener("change", () => this.#fault());
    select("board-rate").addEventListener("change", () => {
      const { value } = select("board-rate");
      send({ do: "rate", rate: value === "max" ? value : Number(value) });
    });
    input("step-what").addEventListener("keydown", (event) => {
      if (event.key === "Enter") this.step();
    });
  }

  /**
   * @param {string} id
   * @param {() => void} act
   */
  #on(id, act) {
    byId(id, HTMLButtonElement).addEventListener("click", act);
  }

  /**
   * A description has come: show what this board can be asked.
   * @param {{control: boolean, time: string, manual?: Manual}} description
   */
  open(description) {
    this.there = description.control;
    byId("control", HTMLElement).hidden = !this.there;
    if (!description.manual) return;
    this.manual = description.manual;
    const realtime = description.time === "realtime";
    byId("alone-label", HTMLElement).hidden = realtime;
    byId("rate-label", HTMLElement).hidden = !realtime;
    offer(select("hand-chip"), this.manual.chips.map((chip) => chip.name));
    offer(select("pin"), this.manual.pins);
    offer(select("fault"), this.manual.faults.map((fault) => fault.name));
    this.#kind();
    this.#fault();
  }

  /** Another kind of step was chosen. */
  #kind() {
    const by = select("step-by").value;
    const { label, value } = STEPS[by];
    byId("step-label", HTMLElement).textContent = label;
    input("step-what").value = value || (by === "sample" ? (this.manual.chips[0]?.name ?? "") : "");
    offer(byId("step-choices", HTMLDataListElement),
      by === "edge" ? this.manual.edges : by === "sample" ? this.manual.chips.map((chip) => chip.name) : []);
  }

  /** Another fault was chosen. */
  #fault() {
    const fault = this.manual.faults.find(({ name }) => name === select("fault").value);
    if (!fault) return;
    select("fault").title = fault.title;
    input("fault-target").value = fault.target === "link" ? "host0" : (this.manual.chips[0]?.name ?? "");
    input("fault-parameters").placeholder = fault.parameters.map((name) => `${name}=`).join(" ") || "none";
  }

  /** Pause, or go on. */
  toggle() {
    if (this.there) this.send({ do: this.paused ? "go" : "pause" });
  }

  /** Make the step that is chosen. */
  step() {
    if (!this.there) return;
    const by = select("step-by").value;
    const what = input("step-what").value.trim();
    /** @type {Record<string, unknown>} */
    const order = { do: "step", by, [STEPS[by].key]: by === "cycle" ? Number(what) : what };
    if (input("alone").checked && by !== "cycle") order.alone = true;
    this.send(order);
  }

  /** @param {boolean} write */
  #cycle(write) {
    const order = { do: "cycle", chip: select("hand-chip").value, address: numberOf(input("address").value) };
    const data = numberOf(input("data").value);
    if (Number.isNaN(order.address) || (write && Number.isNaN(data))) {
      this.tell("write address and data as 12, 0x1F or 1FH", true);
      return;
    }
    this.send(write ? { ...order, data } : order);
  }

  #arm() {
    /** @type {Record<string, string>} */
    const parameters = {};
    for (const word of input("fault-parameters").value.split(/\s+/).filter(Boolean)) {
      const [name, value] = word.split("=", 2);
      if (value === undefined) {
        this.tell(`found "${word}"; write a parameter as NAME=VALUE`, true);
        return;
      }
      parameters[name] = value;
    }
    this.send({
      do: "fault.arm", name: select("fault").value, target: input("fault-target").value.trim(),
      when: input("fault-when").value.trim() || null, until: input("fault-until").value.trim() || null, parameters,
    });
  }

  /**
   * Take what the server says.
   * @param {Answer} answer
   */
  take(answer) {
    const { control } = answer;
    if (control) {
      this.paused = control.state === "paused";
      byId("pause", HTMLButtonElement).setAttribute("aria-pressed", String(this.paused));
      byId("control-state", HTMLElement).textContent =
        control.state === control.text ? control.text : `${control.state}: ${control.text}`;
      const rate = select("board-rate");
      const value = String(control.rate ?? 1);
      if (![...rate.options].some((option) => option.value === value)) rate.add(new Option(value, value));
      rate.value = value;
      return;
    }
    this.tell(answer.answer, Boolean(answer.error));
    const fork = byId("fork", HTMLAnchorElement);
    if (answer.link) fork.href = answer.link;
    fork.hidden = !answer.link;
  }

  /**
   * Say what has come of an order.
   * @param {string} text
   * @param {boolean} wrong
   */
  tell(text, wrong) {
    const told = byId("control-told", HTMLElement);
    told.textContent = text;
    told.classList.toggle("wrong", wrong);
  }
}
