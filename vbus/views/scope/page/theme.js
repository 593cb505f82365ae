// Light and dark: as the system has it, or as chosen; and the colours for the canvases.

const CHOICE = "vbus-scope-theme";
const DARK = matchMedia("(prefers-color-scheme: dark)");

/** Return the theme that was chosen, "" if it is the system's. */
export function chosenTheme() {
  try {
    return localStorage.getItem(CHOICE) ?? "";
  } catch {
    return "";
  }
}

/**
 * Choose a theme: "light", "dark", or "" for the system's.
 * @param {string} theme
 */
export function chooseTheme(theme) {
  try {
    localStorage.setItem(CHOICE, theme);
  } catch {
    // A page from a file may keep nothing.
  }
  applyTheme(theme);
}

/** @param {string} theme */
export function applyTheme(theme) {
  document.documentElement.dataset.theme = theme || (DARK.matches ? "dark" : "light");
}

/**
 * Call when the system changes its theme.
 * @param {() => void} changed
 */
export function onSystemTheme(changed) {
  DARK.addEventListener("change", changed);
}

/**
 * Return the colours of the theme for the canvases.
 * @returns {import("./draw.js").Colours}
 */
export function themeColours() {
  const style = getComputedStyle(document.documentElement);
  /** @param {string} name */
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  const lanes = ["desired", "real", "profile", "error", "velocity", "output", "current", "load", "line", "other"];
  return {
    surface: colour("surface"),
    band: colour("band"),
    grid: colour("grid"),
    strong: colour("strong"),
    text: colour("text"),
    muted: colour("muted"),
    accent: colour("accent"),
    A: colour("a"),
    B: colour("b"),
    violation: colour("violation"),
    fault: colour("fault"),
    interrupt: colour("interrupt"),
    host: colour("host"),
    lanes: Object.fromEntries(lanes.map((name) => [name, colour(`lane-${name}`)])),
    packets: [0, 1, 2, 3, 4, 5].map((kind) => colour(`packet-${kind}`)),
    edges: [0, 1, 2, 3, 4].map((kind) => colour(`edge-${kind}`)),
  };
}
