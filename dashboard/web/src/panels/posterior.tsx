import { signal } from "@preact/signals";
import type { Posterior, PosteriorParameter, Value } from "../contract";
import { plusMinus, times, withUnit } from "../format";
import { Chart } from "../parts/chart";
import { Choice, Key, Panel } from "../parts/panel";
import { posteriors } from "../run";

export const SCALES = ["fitting", "newest", "prior"] as const;
export type Scale = (typeof SCALES)[number];
export const scale = signal<Scale>("fitting");

/** At least so much of the height is the newest posterior's, where the scale is to fit. */
const VISIBLE = 1 / 10;

interface Span {
  low: number;
  high: number;
}

function span(values: Value[]): Span | null {
  const given = values.filter((value): value is number => value !== null);
  return given.length ? { low: Math.min(...given), high: Math.max(...given) } : null;
}

const size = (one: Span) => one.high - one.low;
const widened = ({ low, high }: Span, by: number): [number, number] => {
  const room = (high - low) * by || Math.abs(high) * 1e-6 || 1;
  return [low - room, high + room];
};
const priorSpan = ({ prior_mean, prior_sd }: PosteriorParameter): Span | null =>
  prior_mean === null || prior_sd === null ? null : { low: prior_mean - 2 * prior_sd, high: prior_mean + 2 * prior_sd };

/** What of a parameter's axis is shown: the largest of prior, all that was learnt, and the newest, in which the newest can be seen. */
export function range(history: PosteriorParameter[], chosen: Scale): [number, number] | null {
  const newest = history[history.length - 1]!;
  const last = span(newest.quantiles);
  const prior = priorSpan(newest);
  const learnt = span(history.slice(history.length > 1 ? 1 : 0).flatMap((one) => one.quantiles));
  if (!last) return prior && widened(prior, 0.1);
  const whole = prior && learnt ? { low: Math.min(prior.low, learnt.low), high: Math.max(prior.high, learnt.high) } : prior;
  const fits = (one: Span | null): one is Span => one !== null && size(last) >= VISIBLE * size(one);
  if (chosen === "prior" && whole) return widened(whole, 0.06);
  if (chosen === "fitting" && fits(whole)) return widened(whole, 0.06);
  if (chosen === "fitting" && fits(learnt)) return widened(learnt, 0.1);
  return widened(last, 0.75);
}

/** The prior's ±2 sd as a rule, and the posterior's 95 % on it, however narrow. */
function Rule({ parameter }: { parameter: PosteriorParameter }) {
  const prior = priorSpan(parameter);
  const [low, , , , high] = parameter.quantiles;
  if (!prior || low == null || high == null) return null;
  const at = (value: number) => 10 + 80 * Math.min(1.1, Math.max(-0.1, (value - prior.low) / size(prior)));
  const label = `On the prior's scale: 95 % of the posterior between ${Math.round(((low - prior.low) / size(prior)) * 100)} and ${Math.round(((high - prior.low) / size(prior)) * 100)} % of the prior's width`;
  return (
    <svg class="rule" viewBox="0 0 100 6" preserveAspectRatio="none" role="img" aria-label={label}>
      <rect class="prior" x="10" y="2" width="80" height="2" />
      <rect class="posterior" x={at((low + high) / 2) - Math.max(0.5, (at(high) - at(low)) / 2)} y="0" width={Math.max(1, at(high) - at(low))} height="6" />
    </svg>
  );
}

function Parameter({ history, iterations }: { history: PosteriorParameter[]; iterations: number[] }) {
  const newest = history[history.length - 1]!;
  const { name, unit, mean, sd, prior_mean, prior_sd, determined } = newest;
  const narrower = sd && prior_sd ? prior_sd / sd : null;
  const flat = (value: Value) => history.map(() => value);
  const quantile = (k: number) => history.map((one) => one.quantiles[k] ?? null);
  const bound = (sign: number) => (prior_mean === null || prior_sd === null ? null : prior_mean + sign * 2 * prior_sd);
  return (
    <figure class="parameter" data-parameter={name}>
      <figcaption>
        <b>{withUnit(name, unit)}</b>
        <span data-value={mean ?? "null"} data-sd={sd ?? "null"}>{plusMinus(mean, sd)}</span>
      </figcaption>
      <Chart height={132} whole label={`${name} over the iterations: now ${plusMinus(mean, sd)}, prior ${plusMinus(prior_mean, prior_sd)}`}
        x={iterations} range={range(history, scale.value)}
        series={[
          { label: "prior's upper", values: flat(bound(1)), colour: "prior", width: 1, dash: [5, 3], to: "prior's lower" },
          { label: "prior's lower", values: flat(bound(-1)), colour: "prior", width: 1, dash: [5, 3] },
          { label: "97.5 %", values: quantile(4), colour: "posterior", width: 0, to: "2.5 %" },
          { label: "2.5 %", values: quantile(0), colour: "posterior", width: 0 },
          { label: "75 %", values: quantile(3), colour: "posterior", width: 0, to: "25 %" },
          { label: "25 %", values: quantile(1), colour: "posterior", width: 0 },
          { label: "mean", values: history.map((one) => one.mean), colour: "posterior", width: 2 },
        ].map((one) => ({ ...one, points: one.label === "mean" }))} />
      <Rule parameter={newest} />
      <p class="aside">
        prior {plusMinus(prior_mean, prior_sd)}{narrower && narrower > 1.05 ? `: ${times(narrower)} times wider` : ""}
        {determined ? "" : iterations.length > 1 ? "; the motion does not determine it by itself" : "; nothing has been learnt yet"}
      </p>
    </figure>
  );
}

const rows = ({ iteration, parameters }: Posterior) =>
  parameters.map((one) => [iteration, one.name, one.mean, one.sd, ...one.quantiles, one.prior_mean, one.prior_sd]);

export function PosteriorPanel() {
  const all = posteriors.value;
  const newest = all[all.length - 1];
  return (
    <Panel id="posterior" title="What is known of each parameter" size="full" empty={!newest && "The calibrator has said nothing yet."}
      aside={<Choice name="Scale of the parameters" options={SCALES} value={scale.value} choose={(to) => (scale.value = to)} />}
      what="The posterior of each parameter over the iterations of calibration, 50 and 95 % of it shaded, and the prior's ±2 standard deviations; the rule below each shows the posterior on the prior's scale."
      numbers={() => [{
        caption: "Posterior and prior of each iteration",
        columns: ["iteration", "parameter", "mean", "sd", "2.5 %", "25 %", "50 %", "75 %", "97.5 %", "prior mean", "prior sd"],
        rows: all.flatMap(rows),
      }]}>
      <Key items={[["posterior", "posterior"], ["prior dash", "prior"]]} />
      <div class="parameters">
        {newest?.parameters.map(({ name }, i) => (
          <Parameter key={name} iterations={all.map((one) => one.iteration)} history={all.flatMap((one) => one.parameters[i] ?? [])} />
        ))}
      </div>
    </Panel>
  );
}
