// ---- elements, numbers and colours

/** A new element; text is never parsed as markup. */
function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

const byId = (id) => document.getElementById(id);

/** A number with about `digits` significant digits; a dash for a gap. */
function formatNumber(value, digits = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  const text = size !== 0 && (size >= 1e5 || size < 1e-3)
    ? value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e")
    : String(Number(value.toPrecision(digits)));
  return text.replaceAll("-", "−");
}

const formatUnit = (unit) => unit.replaceAll("^2", "²") || "1";

// Palette of M. Okabe and K. Ito, Color Universal Design (2008), as in the printed plots; in the dark scheme black is white.
const PALETTE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8A8A00"];
const DASHES = [[], [6, 3], [2, 3], [8, 3, 2, 3]];
const darkScheme = matchMedia("(prefers-color-scheme: dark)");
const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");

function paletteColour(index) {
  const colour = PALETTE[index % PALETTE.length];
  return darkScheme.matches && colour === "#000000" ? "#FFFFFF" : darkScheme.matches && colour === "#0072B2" ? "#3D9BE0" : colour;
}

const cssVariable = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
