import { signal } from "@preact/signals";
import { useEffect, useRef, useState } from "preact/hooks";
import type { Posterior, Value } from "../contract";
import { number, withUnit } from "../format";
import { Choice, Key, Panel } from "../parts/panel";
import { posteriors } from "../run";
import { colour, colours } from "../theme";

const MOST = 6; // parameters at once: more are not read
const BINS = 18;
const PAIR_SCALES = ["posterior", "prior"] as const;
const scale = signal<(typeof PAIR_SCALES)[number]>("posterior");

const column = (samples: Value[][], i: number) => samples.map((one) => one[i]).filter((value): value is number => value != null);

/** The middle 98 % of samples, with some room. */
function extent(values: number[]): [number, number] {
  const sorted = [...values].sort((a, b) => a - b);
  const low = sorted[Math.floor(0.01 * (sorted.length - 1))] ?? 0, high = sorted[Math.ceil(0.99 * (sorted.length - 1))] ?? 1;
  const room = (high - low) * 0.12 || Math.abs(high) * 1e-6 || 1;
  return [low - room, high + room];
}

export function correlation(samples: Value[][], i: number, j: number): number | null {
  const both = samples.filter((one) => one[i] != null && one[j] != null) as number[][];
  const mean = (k: number) => both.reduce((sum, one) => sum + one[k]!, 0) / both.length;
  const a = mean(i), b = mean(j);
  let ab = 0, aa = 0, bb = 0;
  for (const one of both) {
    ab += (one[i]! - a) * (one[j]! - b);
    aa += (one[i]! - a) ** 2;
    bb += (one[j]! - b) ** 2;
  }
  return aa > 0 && bb > 0 ? ab / Math.sqrt(aa * bb) : null;
}

function draw(canvas: HTMLCanvasElement, { parameters, samples, prior_samples }: Posterior, chosen: number[], width: number) {
  const n = chosen.length, left = 8, gap = 8, label = 30;
  const cell = Math.floor((width - left - (n - 1) * gap) / n);
  const tall = Math.min(cell, 150);
  const height = n * (tall + gap) + label;
  const dense = devicePixelRatio;
  canvas.width = width * dense;
  canvas.height = height * dense;
  canvas.style.height = `${height}px`;
  const pen = canvas.getContext("2d")!;
  pen.scale(dense, dense);
  pen.font = "11px system-ui, sans-serif";
  const ranges = chosen.map((i) => extent(column(scale.value === "prior" ? [...prior_samples, ...samples] : samples, i)));
  const share = (value: number, k: number) => (value - ranges[k]![0]) / (ranges[k]![1] - ranges[k]![0]);

  for (let row = 0; row < n; row++) {
    for (let col = 0; col <= row; col++) {
      const x0 = left + col * (cell + gap), y0 = row * (tall + gap);
      pen.save();
      pen.beginPath();
      pen.rect(x0, y0, cell, tall);
      pen.fillStyle = colour("card");
      pen.fill();
      pen.clip();
      const clouds: [Value[][], string, number][] = [[prior_samples, "prior", 0.35], [samples, "posterior", 0.6]];
      for (const [cloud, name, opacity] of clouds) {
        pen.fillStyle = colour(name, opacity);
        if (row === col) {
          const counts = new Array<number>(BINS).fill(0);
          const values = column(cloud, chosen[row]!);
          for (const value of values) {
            const bin = Math.floor(share(value, row) * BINS);
            if (bin >= 0 && bin < BINS) counts[bin]!++;
          }
          const most = Math.max(1, ...counts);
          // Few of a wide prior's samples are in a narrow picture: its bars are drawn for what they are, a share of all.
          const unit = name === "prior" ? Math.max(most, values.length / BINS) : most;
          counts.forEach((count, bin) => {
            const bar = (count / unit) * tall * 0.88;
            pen.fillRect(x0 + (bin * cell) / BINS, y0 + tall - bar, cell / BINS - 0.5, bar);
          });
        } else {
          for (const one of cloud) {
            const x = one[chosen[col]!], y = one[chosen[row]!];
            if (x == null || y == null) continue;
            pen.beginPath();
            pen.arc(x0 + share(x, col) * cell, y0 + (1 - share(y, row)) * tall, 1.8, 0, 2 * Math.PI);
            pen.fill();
          }
        }
      }
      pen.restore();
      pen.strokeStyle = colour("rule");
      pen.strokeRect(x0 + 0.5, y0 + 0.5, cell - 1, tall - 1);
      if (row === col) {
        pen.fillStyle = colour("ink");
        pen.textAlign = "left";
        pen.fillText(parameters[chosen[row]!]!.name, x0 + 6, y0 + 14, cell - 12);
      }
      if (row === n - 1) {
        pen.fillStyle = colour("muted");
        pen.textAlign = "left";
        pen.fillText(number(ranges[col]![0], 4), x0, y0 + tall + 13, cell / 2);
        pen.textAlign = "right";
        pen.fillText(number(ranges[col]![1], 4), x0 + cell, y0 + tall + 13, cell / 2);
        pen.textAlign = "center";
        pen.fillText(parameters[chosen[col]!]!.unit ?? "", x0 + cell / 2, y0 + tall + 26, cell);
      }
    }
    for (let col = row + 1; col < n; col++) {
      const r = correlation(samples, chosen[row]!, chosen[col]!);
      const x0 = left + col * (cell + gap), y0 = row * (tall + gap);
      pen.fillStyle = r === null ? colour("muted") : colour("posterior", 0.25 + 0.75 * Math.abs(r));
      pen.textAlign = "center";
      pen.font = `${Math.min(20, cell / 5)}px system-ui, sans-serif`;
      pen.fillText(r === null ? "–" : r.toFixed(2).replace("-", "−"), x0 + cell / 2, y0 + tall / 2 + 6);
      pen.font = "11px system-ui, sans-serif";
    }
  }
}

function Plot({ posterior, chosen }: { posterior: Posterior; chosen: number[] }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [width, setWidth] = useState(0);
  useEffect(() => {
    const watch = new ResizeObserver(([entry]) => entry && setWidth(Math.floor(entry.contentRect.width)));
    watch.observe(canvas.current!.parentElement!);
    return () => watch.disconnect();
  }, []);
  const paint = `${width} ${chosen} ${scale.value} ${colours.value}`;
  useEffect(() => {
    if (width > 0 && chosen.length > 0) draw(canvas.current!, posterior, chosen, width);
  }, [posterior, paint]);
  return <canvas class="pairs" ref={canvas} role="img" aria-label="Samples of each pair of parameters; their correlations are among the numbers" />;
}

export function PairsPanel() {
  const newest = posteriors.value[posteriors.value.length - 1];
  const parameters = newest?.parameters ?? [];
  const [hidden, setHidden] = useState<ReadonlySet<string>>(new Set());
  const shown = parameters.map((_, i) => i).filter((i) => !hidden.has(parameters[i]!.name)).slice(0, MOST);
  const toggle = (name: string) => setHidden((now) => new Set(now.has(name) ? [...now].filter((one) => one !== name) : [...now, name]));
  return (
    <Panel id="pairs" size="tall" title="Which parameters go together" empty={!newest && "The calibrator has said nothing yet."}
      aside={<Choice name="Scale of the pairs" options={PAIR_SCALES} value={scale.value} choose={(to) => (scale.value = to)} />}
      what="Samples of the posterior and of the prior, of each pair of parameters, and the posterior's correlations: parameters on a line can only be known together."
      numbers={() => [{
        caption: "Correlations of the posterior's samples", columns: ["", ...parameters.map((one) => one.name)],
        rows: parameters.map((one, i) => [one.name, ...parameters.map((_, j) => correlation(newest!.samples, i, j))]),
      }]}>
      <Key items={[["posterior dot", "posterior"], ["prior dot", "prior"]]} />
      {newest && <Plot posterior={newest} chosen={shown} />}
      {parameters.length > 2 && (
        <div class="choice many" role="group" aria-label="Parameters shown">
          {parameters.map(({ name, unit }, i) => <button key={name} title={withUnit(name, unit)} aria-pressed={shown.includes(i)} onClick={() => toggle(name)}>{name}</button>)}
        </div>
      )}
    </Panel>
  );
}
