import type { Value } from "./contract";

export const DASH = "–";
const MINUS = "−";

const given = (value: Value | undefined): value is number => value !== null && value !== undefined && Number.isFinite(value);
const proper = (text: string) => text.replace(/-/g, MINUS);

/** A number to so many significant digits, in the shortest way; a dash for what is not given. */
export function number(value: Value | undefined, digits = 4): string {
  if (!given(value)) return DASH;
  const size = Math.abs(value);
  if (value === 0) return "0";
  if (Number.isInteger(value) && size < 1e15) return grouped(value);
  if (size >= 1e6 || size < 1e-4) return proper(value.toExponential(Math.min(digits, 3) - 1).replace("e+", "e"));
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  return proper(value.toFixed(decimals));
}

/** A count, its thousands apart. */
export function grouped(value: Value | undefined): string {
  if (!given(value)) return DASH;
  const text = String(Math.round(Math.abs(value)));
  return (value < 0 ? MINUS : "") + (text.length > 4 ? text.replace(/\B(?=(\d{3})+$)/g, "\u202f") : text);
}

/** A mean to the digits that its sd leaves it: 10.418 ± 0.469. */
export function plusMinus(mean: Value | undefined, sd: Value | undefined): string {
  if (!given(mean) || !given(sd)) return `${number(mean)} ± ${number(sd)}`;
  if (sd <= 0 || sd < Math.abs(mean) * 1e-9) return `${number(mean, 6)} ± ${number(sd, 2)}`;
  const decimals = Math.min(12, Math.max(0, 1 - Math.floor(Math.log10(sd))));
  return proper(`${mean.toFixed(decimals)} ± ${sd.toFixed(decimals)}`);
}

/** How many times larger, to two digits. */
export function times(ratio: number): string {
  return ratio >= 100 ? grouped(Number(ratio.toPrecision(2))) : String(Number(ratio.toPrecision(2)));
}

export const withUnit = (name: string, unit: string | null | undefined) => (unit && unit !== "1" ? `${name} [${unit}]` : name);

/** An age or a duration [s], in the unit that suits it. */
export function seconds(value: Value | undefined): string {
  if (!given(value)) return DASH;
  if (value < 1e-3) return `${number(value * 1e6, 2)} µs`;
  if (value < 1) return `${number(value * 1e3, 2)} ms`;
  if (value < 100) return `${number(value, 2)} s`;
  if (value < 6000) return `${Math.round(value / 60)} min`;
  return `${Math.round(value / 3600)} h`;
}

export function bytes(value: Value | undefined): string {
  if (!given(value)) return DASH;
  if (value < 1000) return `${Math.round(value)} B`;
  return value < 1e6 ? `${number(value / 1e3, 3)} kB` : `${number(value / 1e6, 3)} MB`;
}

/** The time of day of a utime; of a run in virtual time, whose day means nothing, the time since its begin. */
export function clock(utime: number, begin: number | null): string {
  if (begin === null) return new Date(utime / 1000).toLocaleTimeString("en-GB");
  const since = Math.max(0, utime - begin) / 1e6;
  const minutes = Math.floor(since / 60);
  return `${minutes}:${(since - 60 * minutes).toFixed(2).padStart(5, "0")}`;
}
