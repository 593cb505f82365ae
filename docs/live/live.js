/**
 * Runs a driver on a board in the reader's browser. The page's side makes the fields, from the
 * blocks of the page; Python runs in a worker, which is this file again.
 */

const HERE = new URL(".", import.meta.url);

/** @typedef {{printed: string, hash: string, page: string}} Result */

if (typeof document === "undefined") {
  work();
} else {
  show(/** @type {HTMLElement} */ (document.getElementById("live")));
}

/** The worker: get Python ready, say so, and run what comes. */
async function work() {
  const { loadPyodide } = await import(new URL("pyodide.mjs", HERE).href);
  const [python, packages] = await Promise.all([
    loadPyodide({ indexURL: HERE.href }),
    fetch(new URL("packages.zip", HERE)).then((answer) => answer.arrayBuffer()),
  ]);
  const { purelib } = python.pyimport("sysconfig").get_paths().toJs();
  python.unpackArchive(packages, "zip", { extractDir: purelib });
  const live = python.pyimport("live");
  addEventListener("message", ({ data: [board, driver] }) => {
    postMessage(live.run(board, driver).toJs({ dict_converter: Object.fromEntries }));
  });
  postMessage("ready");
}

/**
 * The page: fields with the page's own board file and driver, and what comes of them.
 * @param {HTMLElement} place
 */
function show(place) {
  const board = field("axis.toml", ".highlight-toml pre");
  const driver = field("axis.py", ".highlight-python pre");
  const button = document.createElement("button");
  const status = document.createElement("output");
  const printed = document.createElement("pre");
  const scope = document.createElement("iframe");
  scope.title = "The scope, with the lanes of this run";
  scope.hidden = printed.hidden = true;
  place.replaceChildren(...board.parts, ...driver.parts, button, status, printed, scope);

  /** @type {Worker | undefined} */
  let worker;

  /** @param {string} [why] */
  const stop = (why = "") => {
    worker?.terminate();
    worker = undefined;
    rest(why);
  };
  /** @param {string} said */
  const rest = (said) => {
    button.textContent = "Run";
    button.onclick = run;
    status.textContent = said;
  };
  const run = () => {
    button.textContent = "Stop";
    button.onclick = () => stop("stopped");
    if (worker === undefined) {
      status.textContent = "Python is loaded from this site (some 14 MB) …";
      worker = new Worker(import.meta.url, { type: "module" });
      worker.onerror = (event) => stop(`Python cannot run here: ${event.message || location}`);
      worker.onmessage = ({ data }) => {
        if (data === "ready") {
          send();
        } else {
          finish(data);
        }
      };
    } else {
      send();
    }
  };
  const send = () => {
    status.textContent = "running …";
    worker?.postMessage([board.text(), driver.text()]);
  };
  /** @param {Result} result */
  const finish = (result) => {
    rest(result.hash && `trace hash ${result.hash}`);
    printed.hidden = false;
    printed.textContent = result.printed;
    scope.hidden = !result.page;
    scope.srcdoc = result.page;
  };
  rest("");
}

/**
 * Return a field that has the text of a block of the page.
 * @param {string} name
 * @param {string} block
 */
function field(name, block) {
  const area = document.createElement("textarea");
  area.value = document.querySelector(block)?.textContent ?? "";
  area.rows = area.value.split("\n").length;
  area.spellcheck = false;
  area.id = `live-${name}`;
  const label = document.createElement("label");
  label.htmlFor = area.id;
  label.textContent = name;
  return { parts: [label, area], text: () => area.value };
}
