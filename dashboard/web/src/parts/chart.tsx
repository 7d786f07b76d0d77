// A plot over x: lines, bands and points, by uPlot.
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import type { Value } from "../contract";
import { number } from "../format";
import { colour, colours } from "../theme";

export interface Series {
  label: string;
  values: Value[];
  colour: string; // name of a colour of style/colours.css
  opacity?: number;
  width?: number; // 0: no line
  dash?: number[];
  points?: boolean;
  to?: string; // label of another series: what is between them is filled
}

interface ChartProperties {
  label: string; // what a reader who does not see it is told
  x: number[];
  series: Series[];
  height?: number;
  x_label?: string;
  range?: [number, number] | null; // of y
  logarithmic?: boolean; // y
  logarithmic_x?: boolean;
  whole?: boolean; // x has whole numbers
  ticks?: number[]; // of x
  line?: { at: number; colour: string; label: string }; // across
}

const FONT = "11px system-ui, sans-serif";
const FILL = 0.16;

function spread([low, high]: [number, number], logarithmic: boolean): [number, number] {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return logarithmic ? [0.1, 10] : [0, 1];
  if (logarithmic) {
    const room = Math.max(0.05, (Math.log10(high) - Math.log10(low)) * 0.08);
    return [low * 10 ** -room, high * 10 ** room];
  }
  const room = (high - low) * 0.06 || Math.abs(high) * 0.02 || 1;
  return [low - room, high + room];
}

/** Numbers of an axis, to as many digits as tell them apart. */
function tickLabels(ticks: (number | null)[]): string[] {
  const given = ticks.filter((tick): tick is number => tick !== null);
  if (given.length < 2) return ticks.map((tick) => (tick === null ? "" : number(tick, 3)));
  const step = Math.abs(given[1]! - given[0]!);
  const size = Math.max(...given.map(Math.abs), 0);
  return ticks.map((tick) => {
    if (tick === null) return "";
    if (tick === 0) return "0";
    if (size >= 1e5 || size < 1e-3) return number(tick, 2);
    const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return tick.toFixed(Math.min(decimals, 8)).replace("-", "−");
  });
}

/** Of a logarithmic axis: powers of ten, with 2 and 5 between where there are few. */
function logarithmicLabels(ticks: (number | null)[]): string[] {
  const given = ticks.filter((tick): tick is number => tick !== null);
  const few = Math.max(...given) < 30 * Math.min(...given);
  const leading = (tick: number) => Math.round(tick / 10 ** Math.floor(Math.log10(tick) + 1e-9));
  return ticks.map((tick) => (tick !== null && (leading(tick) === 1 || (few && [2, 5].includes(leading(tick)))) ? number(tick, 1) : ""));
}

function options(properties: ChartProperties, width: number): uPlot.Options {
  const { x, series, height = 180, x_label, range, logarithmic = false, logarithmic_x = false, whole, ticks, line } = properties;
  const axis = { stroke: colour("muted"), font: FONT, labelFont: FONT, grid: { stroke: colour("grid"), width: 1 }, ticks: { show: false } };
  const place = (label: string) => series.findIndex((one) => one.label === label) + 1;
  return {
    width, height,
    padding: [8, 12, x_label ? 0 : 2, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: {
      x: { time: false, distr: logarithmic_x ? 3 : 1, range: (_, low, high) => (low === high ? [low - 0.5, high + 0.5] : logarithmic_x ? [low / 1.1, high * 1.1] : [low, high]) },
      y: { distr: logarithmic ? 3 : 1, range: range ?? ((_, low, high) => spread([low, high], logarithmic)) },
    },
    axes: [
      {
        ...axis, size: x_label ? 24 : 22, gap: 4, space: 44, ...(x_label ? { label: x_label, labelSize: 16, labelGap: -2 } : {}),
        ...(whole ? { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1e3, 2e3, 5e3, 1e4, 1e5] } : {}),
        ...(ticks ? { splits: () => ticks, filter: (_, splits) => splits } : {}),
        values: (_, splits) => (logarithmic_x ? splits.map((tick) => (tick === null ? "" : number(tick))) : tickLabels(splits)),
      },
      {
        ...axis, size: (_, values) => 16 + 6.2 * Math.max(2, ...(values ?? []).map((value) => value?.length ?? 0)), gap: 5, space: logarithmic ? 22 : 24,
        values: (_, splits) => (logarithmic ? logarithmicLabels(splits) : tickLabels(splits)),
        ...(logarithmic ? { filter: (_, splits) => splits } : {}),
      },
    ],
    series: [
      {},
      ...series.map((one): uPlot.Series => ({
        label: one.label, stroke: colour(one.colour, one.opacity), width: one.width ?? 1.8, spanGaps: true,
        ...(one.dash ? { dash: one.dash } : {}),
        points: { show: one.points ?? (x.length === 1 && one.width !== 0), size: one.width === 0 ? 5 : 6, width: 0, fill: colour(one.colour, one.opacity), stroke: "transparent" },
      })),
    ],
    bands: series.flatMap((one, i) => (one.to ? [{ series: [i + 1, place(one.to)] as [number, number], fill: colour(one.colour, FILL * (one.opacity ?? 1)) }] : [])),
    hooks: line ? {
      draw: [(plot) => {
        const y = plot.valToPos(line.at, "y", true);
        if (y < plot.bbox.top || y > plot.bbox.top + plot.bbox.height) return;
        plot.ctx.save();
        plot.ctx.strokeStyle = plot.ctx.fillStyle = colour(line.colour);
        plot.ctx.setLineDash([4 * devicePixelRatio, 4 * devicePixelRatio]);
        plot.ctx.beginPath();
        plot.ctx.moveTo(plot.bbox.left, y);
        plot.ctx.lineTo(plot.bbox.left + plot.bbox.width, y);
        plot.ctx.stroke();
        plot.ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
        plot.ctx.textAlign = "right";
        plot.ctx.fillText(line.label, plot.bbox.left + plot.bbox.width - 4, y - 4 * devicePixelRatio);
        plot.ctx.restore();
      }],
    } : {},
  };
}

export function Chart(properties: ChartProperties) {
  const box = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const { x, series, range, label, height = 180 } = properties;
  const data = [x, ...series.map((one) => one.values)] as uPlot.AlignedData;
  // What a plot cannot learn later makes a new one.
  const shape = JSON.stringify([colours.value, range, height, properties.ticks, properties.line, x.length === 1, series.map(({ values, ...rest }) => rest)]);

  useEffect(() => {
    const here = box.current!;
    const drawn = (plot.current = new uPlot(options(properties, here.clientWidth), data, here));
    const watch = new ResizeObserver(() => here.clientWidth && here.clientWidth !== drawn.width && drawn.setSize({ width: here.clientWidth, height }));
    watch.observe(here);
    return () => {
      watch.disconnect();
      drawn.destroy();
    };
  }, [shape]);
  useEffect(() => plot.current?.setData(data), [data]);
  return <div class="chart" ref={box} role="img" aria-label={label} style={{ height: `${height}px` }} />;
}
