// Axes of the figures that the page makes, and the units of their numbers.

const UNITS = {
  m: [[1e12, "pm", 2e-9], [1e9, "nm", 2e-6], [1e6, "µm", Infinity]],
  N: [[1e12, "pN", 1e-9], [1e9, "nN", 1e-6], [1e6, "µN", Infinity]],
};

/** A factor and a unit for values of a size in m or N; without a unit they stay as they are. */
export const scale = (size, base) => UNITS[base]?.find(([, , below]) => size < below) ?? [1, ""];

/** A linear axis with this title, unit and range. */
export const axis = (words, unit, range) => ({ label: unit ? `${words} (${unit})` : words, unit: "", scale: "linear", range: { fixed: range }, marks: null });
