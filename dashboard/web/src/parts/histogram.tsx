// Counts in bins of durations: bin i has [2^i, 2^(i+1)) us, as DRIVER_STATUS has them.
import { grouped, number, seconds } from "../format";

export const lower = (bin: number) => (bin === 0 ? 0 : 2 ** bin * 1e-6);
export const upper = (bin: number) => 2 ** (bin + 1) * 1e-6;

/** What a share of all does not exceed: its bin's upper end, "< 2.0 ms"; of the last bin, which has all that are longer, its
 * lower one, "> 0.5 s". Null without any. */
export function quantile(counts: number[], share: number): string | null {
  const total = counts.reduce((sum, count) => sum + count, 0);
  let below = 0;
  for (let bin = 0; total > 0 && bin < counts.length; bin++) {
    below += counts[bin]!;
    if (below >= share * total) return bin + 1 < counts.length ? `< ${seconds(upper(bin))}` : `> ${seconds(lower(bin))}`;
  }
  return null;
}

/** Of the bins that hold something, or the first ten. The scale is logarithmic: one late cycle in a million is seen. */
export function Histogram({ counts, label, small = false }: { counts: number[]; label: string; small?: boolean }) {
  const used = Math.max(small ? counts.length : 10, counts.findLastIndex((count) => count > 0) + 1);
  const most = Math.log10(Math.max(1, ...counts) + 1);
  const height = small ? 18 : 110;
  const bars = counts.slice(0, used).map((count, bin) => {
    const tall = count > 0 ? Math.max(2, (Math.log10(count + 1) / most) * height) : 0;
    return (
      <rect key={bin} x={bin * 10 + 1} y={height - tall} width={8} height={tall} rx={1}>
        <title>{`${number(lower(bin) * 1e6)} to ${bin + 1 < counts.length ? seconds(upper(bin)) : "∞"}: ${grouped(count)}`}</title>
      </rect>
    );
  });
  return (
    <div class={small ? "histogram small" : "histogram"} role="img" aria-label={label}>
      <svg viewBox={`0 0 ${used * 10} ${height}`} preserveAspectRatio="none" style={{ height: `${height}px` }}>{bars}</svg>
      {!small && (
        <div class="bins" aria-hidden="true">
          {counts.slice(0, used).map((_, bin) => <span key={bin}>{bin % 3 === 0 ? seconds(2 ** bin * 1e-6) : ""}</span>)}
        </div>
      )}
    </div>
  );
}
