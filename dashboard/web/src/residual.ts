// What a learnt residual says, in numbers that can be shown: docs/gap.md has its formula.
import type { residual_function_t } from "./messages";

export interface Learnt {
  change: number[]; // of each output: root mean square over the recorded inputs that it rests on, mean over the draws
  noise: number[]; // standard deviation of what is left
}

/** phi(x) at one of its own centres. */
function features({ num_inputs, num_centres, centre, low, high }: residual_function_t, m: number): number[] {
  const z = Array.from({ length: num_inputs }, (_, i) => Math.min(high[i] ?? 0, Math.max(low[i] ?? 0, centre[m * num_inputs + i] ?? 0)));
  const near = Array.from({ length: num_centres }, (_, k) => {
    let squares = 0;
    for (let i = 0; i < num_inputs; i++) squares += (z[i]! - (centre[k * num_inputs + i] ?? 0)) ** 2;
    return Math.exp(-squares / 2);
  });
  return [1, ...z.map((one) => one / Math.sqrt(num_inputs)), ...near];
}

export function learnt(residual: residual_function_t): Learnt {
  const { num_inputs, num_outputs, num_centres, weight, noise } = residual;
  const width = 1 + num_inputs + num_centres;
  const draws = Math.floor(weight.length / (num_outputs * width));
  const squares = new Array<number>(num_outputs).fill(0);
  for (let m = 0; m < num_centres; m++) {
    const phi = features(residual, m);
    for (let draw = 0; draw < draws; draw++) {
      for (let output = 0; output < num_outputs; output++) {
        const row = (draw * num_outputs + output) * width;
        let change = 0;
        for (let i = 0; i < width; i++) change += (weight[row + i] ?? 0) * phi[i]!;
        squares[output]! += change ** 2;
      }
    }
  }
  return {
    change: squares.map((sum) => Math.sqrt(sum / Math.max(1, num_centres * draws))),
    noise: Array.from({ length: num_outputs }, (_, i) => Math.hypot(...noise.slice(i * num_outputs, (i + 1) * num_outputs).map((one) => one ?? 0))),
  };
}
